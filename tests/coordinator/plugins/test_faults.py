"""Every kind of plug-in with every fault: one line with file and line number.

The plug-ins are those of ``tests/plugins/critters_lab``, each with one change.
"""

import io
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from coordinator.__main__ import plugin_kinds
from coordinator.plugins.checks import check_apart, check_here

CRITTERS = Path(__file__).parents[2] / "plugins" / "critters_lab" / "critters"
Writer = Callable[[str, str], tuple[Path, Path]]
RANDOM = '__import__("random")'


class Plugin(NamedTuple):
    """A plug-in.

    Attributes:
        file: of the package.
        name: of the plug-in.
        document: keys of an experiment that name it as ``LAB:name``.
        body: statement of its code before which a process ends or waits.
    """

    file: str
    name: str
    document: str
    body: str


_PISTON = """[space]
part_types = ["schema.parts:CORE", "schema.parts:ACTIVE_HINGE", "LAB:PISTON"]
"""
_LEAKY = '[space]\nneuron_types = ["Sigmoid", "LAB:Leaky"]\n'
_THRIFTY = '[fitness]\nfunction = "LAB:thrifty"\nparameters = {price = 0.1}\n'
_ELITE = '[selection]\nsurvivors = "LAB:elite_and_young"\n'
_LENGTH = "length = values[0] / 1000.0"
_NEAR = "return [1.0 - distance / REACH_M]"
_STACK = "return np.stack([output, potential])"
_RANDOM = "return tuple(self.joint(rng) for _ in range(count))"
_JOINT = "return 0.5 + 4.5 * rng.random(), rng.random()"
_BUILT = "return rv.Robot(tuple(parts), rv.Brain(tuple(neurons)))"
_SCORE = "return math.hypot(x, y) / seconds - parameters.price * power"
_SWAY = "return float(np.max(height) - np.min(height))"
_PAIR = "return first, second"
_YOUNG = "return elite + others[len(others) - (count - len(elite)) :]"
_SAMPLE = f"return {RANDOM}.sample(range(len(population)), "
PLUGINS = {
    "part-type": Plugin("bodies.py", "PISTON", _PISTON, _LENGTH),
    "sensor": Plugin("bodies.py", "PISTON", _PISTON, _NEAR),
    "neuron-type": Plugin("neurons.py", "Leaky", _LEAKY, _STACK),
    "brain": Plugin(
        "brains.py", "Beat", '[brain]\ntype = "LAB:Beat"\n', "return swing"
    ),
    "encoding": Plugin(
        "genomes.py", "Snakes", '[encoding]\ntype = "LAB:Snakes"\n', _RANDOM
    ),
    "fitness": Plugin("scores.py", "thrifty", _THRIFTY, _SCORE),
    "measure": Plugin("scores.py", "sway", '[measures]\nnames = ["LAB:sway"]\n', _SWAY),
    "parents": Plugin(
        "choices.py", "alike", '[selection]\nparents = "LAB:alike"\n', _PAIR
    ),
    "survivors": Plugin("choices.py", "elite_and_young", _ELITE, _YOUNG),
}
CHANGES = {
    ("part-type", "arity"): ("(values: tuple[float, ...])", "()"),
    ("part-type", "type"): (_LENGTH, "return 3"),
    ("part-type", "finite"): (_LENGTH, 'length = float("nan")'),
    ("part-type", "repeatable"): (_LENGTH, f"length = 0.01 + 0.01 * {RANDOM}.random()"),
    ("sensor", "missing"): ("def read(", "def look("),
    ("sensor", "misspelt"): ('distance("tail"', 'distance("tial"'),
    ("sensor", "arity"): ("(self, view: rv.SensorView)", "(self)"),
    ("sensor", "type"): (_NEAR, 'return ["near"]'),
    ("sensor", "finite"): (_NEAR, 'return [float("inf")]'),
    ("sensor", "repeatable"): (_NEAR, f"return [{RANDOM}.random()]"),
    ("neuron-type", "arity"): ("        tick: rv.Tick,\n", ""),
    ("neuron-type", "type"): (_STACK, 'return "active"'),
    ("neuron-type", "finite"): (_STACK, f"{_STACK} * np.inf"),
    ("neuron-type", "repeatable"): (_STACK, "return np.random.random(state.shape)"),
    ("brain", "arity"): ("readings: Floats, age_ticks: object", "readings: Floats"),
    ("brain", "type"): ("return swing", 'return "wave"'),
    ("brain", "finite"): ("return swing", "return swing * np.inf"),
    ("brain", "repeatable"): ("return swing", "return swing * np.random.random()"),
    ("encoding", "arity"): (
        "def random(self, rng: np.random.Generator, birth: object)",
        "def random(self, rng: np.random.Generator)",
    ),
    ("encoding", "type"): (_BUILT, "return 3"),
    ("encoding", "finite"): ("(period, phase, 1.0)", '(period, phase, float("nan"))'),
    ("encoding", "repeatable"): (_JOINT, f"return {RANDOM}.random(), rng.random()"),
    ("fitness", "arity"): ("trace: rv.Trace, parameters: Thrift", "trace: rv.Trace"),
    ("fitness", "type"): (_SCORE, 'return "fast"'),
    ("fitness", "finite"): (_SCORE, "return math.inf"),
    ("fitness", "repeatable"): (_SCORE, "return np.random.random()"),
    ("measure", "arity"): ("sway(trace: rv.Trace)", "sway()"),
    ("measure", "type"): (_SWAY, "return None"),
    ("measure", "finite"): (_SWAY, "return math.nan"),
    ("measure", "repeatable"): (_SWAY, "return np.random.random()"),
    ("parents", "arity"): (", parameters: None", ""),
    ("parents", "type"): (_PAIR, 'return "both"'),
    ("parents", "finite"): (_PAIR, 'return first, float("nan")'),
    ("parents", "repeatable"): (_PAIR, f"{_SAMPLE}2)"),
    ("survivors", "arity"): ("    count: int,\n", ""),
    ("survivors", "type"): (_YOUNG, "return None"),
    ("survivors", "finite"): (_YOUNG, 'return [float("inf")] * count'),
    ("survivors", "repeatable"): (_YOUNG, f"{_SAMPLE}count)"),
}
"""Of each fault of each kind, a text and what replaces it."""
ENDS = {
    "slow": '__import__("time").sleep(60)',
    "exit": '__import__("sys").exit(3)',
    "os._exit": '__import__("os")._exit(3)',
}
FAULTS = ("missing", "misspelt", "arity", "type", "finite", "repeatable", "exit")
EXPECTED = {
    "missing": "has no 'Nobody'$",
    "misspelt": "did you mean '.*'",
    "arity": "arguments?\\b",
    "type": "must (return|be)",
    "finite": "finite|different whole numbers",
    "repeatable": "the same|must be equal",
    "exit": r"SystemExit: 3( \(.*py:\d+\))?$",
    "slow": "must take at most 0.5 s of CPU time, and 2 s in all, but was still at",
    "os._exit": "must not end its process, but did, with status 3$",
}
APART = ("slow", "os._exit")
"""Faults whose process ends."""


pytestmark = pytest.mark.usefixtures("_nothing_allowed")


@pytest.fixture
def faulty(tmp_path: Path) -> Writer:
    """Return a function that writes an experiment and its faulty plug-in."""

    def write(kind: str, fault: str) -> tuple[Path, Path]:
        plugin = PLUGINS[kind]
        text = (CRITTERS / plugin.file).read_text()
        # Modules stay imported, so each test has its own.
        name = f"{kind}_{fault}".replace("-", "_").replace(".", "_")
        file = tmp_path / f"{name}_lab.py"
        document = plugin.document.replace("LAB", file.stem)
        if fault in ENDS:
            change = plugin.body, f"{ENDS[fault]}; {plugin.body}"
        elif (kind, fault) in CHANGES:
            change = CHANGES[kind, fault]
        else:
            change = "", ""
            name = "Nobody" if fault == "missing" else plugin.name[:-1]
            document = document.replace(f":{plugin.name}", f":{name}")
        old, new = change
        assert text.count(old) == 1 or not old
        file.write_text(text.replace(old, new) if old else text)
        experiment = tmp_path / "mine.toml"
        experiment.write_text(f'name = "mine"\n{document}')
        return experiment, file

    return write


def _faults_here(document: Path) -> list[str]:
    output = io.StringIO()
    check_here([str(document)], plugin_kinds(), None, output, 30.0)
    steps = [json.loads(line) for line in output.getvalue().splitlines()]
    return [text for step, text in steps if step == "fault"]


@pytest.mark.parametrize("kind", PLUGINS)
def test_plug_ins_without_fault_are_in_order(faulty: Writer, kind: str) -> None:
    document, file = faulty(kind, "slow")
    file.write_text((CRITTERS / PLUGINS[kind].file).read_text())
    assert _faults_here(document) == []


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("kind", PLUGINS)
def test_each_fault_of_each_kind_is_one_line(
    faulty: Writer, kind: str, fault: str
) -> None:
    document, file = faulty(kind, fault)
    (line,) = _faults_here(document)
    _check_line(line, file, kind, fault)


@pytest.mark.slow
@pytest.mark.parametrize("fault", APART)
@pytest.mark.parametrize("kind", PLUGINS)
def test_each_end_of_a_process_is_one_line(
    faulty: Writer, kind: str, fault: str
) -> None:
    document, file = faulty(kind, fault)
    (line,) = check_apart([str(document)], limit_s=0.5 if fault == "slow" else 30.0)
    _check_line(line, file, kind, fault)


def _check_line(line: str, file: Path, kind: str, fault: str) -> None:
    print(f"| {kind} | {fault} | `{line[:160]}` |")  # noqa: T201 - the table of docs
    assert "\n" not in line
    # What is not there has no line; the experiment that names it has.
    is_named = fault in ("missing", "misspelt") and kind != "sensor"
    place = "mine.toml" if is_named else file.name
    assert re.search(rf"\b{place}:\d+(: |$)", line), line
    if kind != "sensor" or fault not in ("missing", "misspelt"):
        assert re.search(EXPECTED[fault], line), line
