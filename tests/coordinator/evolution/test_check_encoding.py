"""The check of encodings: the built-in ones pass, broken ones are refused."""

from collections.abc import Callable

import pytest

from coordinator.evolution.check_encoding import check_encoding
from coordinator.evolution.kinds import ENCODING
from schema.errors import ExperimentError
from schema.experiment.document import EncodingSection, Experiment
from schema.experiment.kinds import Use

Own = Callable[..., Experiment]


@pytest.mark.parametrize("name", ["revolve-angle", "cppn"])
def test_built_in_encodings_pass(name: str) -> None:
    check_encoding(Experiment(name="test", encoding=EncodingSection(type=name)))


def test_the_encoding_of_the_page_passes(own_encoding: Own) -> None:
    check_encoding(own_encoding())


CASES = {
    "random is None": (
        "return tuple(self.joint(rng) for",
        "return None and tuple(self.joint(rng) for",
        "random: must return a genome, got None",
    ),
    "a memory": (
        "cut = int(rng.integers(0, len(first) + 1))",
        "cut = self.cut = (getattr(self, 'cut', 0) + 1) % len(first)",
        "crossover and mutate: must return the same twice",
    ),
    "bytes that lose joints": (
        "return msgspec.json.decode(data, type=tuple[Joint, ...])",
        (
            "return self.read(data)[:2]\n\n    def read(self, data):\n"
            "        return msgspec.json.decode(data, type=tuple[Joint, ...])"
        ),
        "from_bytes: must give the genome back",
    ),
    "unreadable bytes": (
        "return msgspec.json.encode(genome)",
        "return msgspec.json.encode(genome)[:-1]",
        "must make robots within [space], got not a genome of encoding",
    ),
    "random development": (
        "values = (joint.period, joint.phase, 1.0)",
        "values = (joint.period, joint.phase, __import__('random').random())",
        "develop: must return the same twice",
    ),
    "too many parts": (
        "space.max_parts - 1, space.max_outputs)",
        "200)\n        self.least = self.most = 11",
        "the robot has 11 outputs, outside space.max_outputs = 10",
    ),
    "a slot that is not there": (
        "slot = 1 if index else 0",
        "slot = 2 if index else 0",
        "must make robots within [space], got body.parts[2].parent_slot: ActiveHinge",
    ),
    "a rotated brick": (
        "return rv.Robot(",
        'parts.append(rv.Part("FixedBrick", 0, 1, 0, 90, GREY));return rv.Robot(',
        "a FixedBrick, is rotated by 90 degrees",
    ),
    "no children": (
        "return child if len(child) >= self.least else None",
        "return None",
        "must make a child of some couple, got None of all 24",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_broken_rule_is_refused_with_file_and_line(
    case: str, own_encoding: Own
) -> None:
    old, new, problem = CASES[case]
    experiment = own_encoding((old, new))
    with pytest.raises(ExperimentError) as caught:
        Use(ENCODING, *ENCODING.sections(experiment)).check()
    file = f"{experiment.encoding.type.partition(':')[0]}.py"
    assert str(caught.value).startswith(f"encoding.type: {file}:15: ")
    assert problem in str(caught.value)


def test_changed_parents_are_refused(own_encoding: Own) -> None:
    experiment = own_encoding(
        ("return tuple(self.joint(rng) for _ in range(count))",
         "return [self.joint(rng) for _ in range(count)]"),
        ("child = first[:cut] + second[cut:]",
         "child = first[:cut] + second[cut:]\n        first.append(second[0])"),
    )  # fmt: skip
    with pytest.raises(ExperimentError, match="crossover and mutate: must"):
        check_encoding(experiment)
