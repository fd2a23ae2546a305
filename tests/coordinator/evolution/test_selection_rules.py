"""Own rules of selection: what they get, and how bad answers are refused."""

import re
import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from itertools import count
from types import ModuleType

import numpy as np
import pytest
from msgspec import structs

from coordinator.evolution import rules as island_rules
from coordinator.evolution.breeding import Individual
from coordinator.evolution.check_rule import check_rule as check_rule_of
from coordinator.evolution.members import Relatives
from coordinator.evolution.rules import Rule, select_survivors
from schema.errors import ExperimentError, UnknownPlugin
from schema.experiment.document import (
    PARENTS,
    SURVIVORS,
    Experiment,
    Measures,
    SelectionSection,
)
from schema.experiment.grid import Grid
from schema.experiment.migration import Migration
from schema.experiment.selection_rules import RuleSection
from schema.robot.genome import Node
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.wire.genome_bytes import encode_genome
from tests.documents import parse_experiment

CORE = encode_genome(Node("Core", -1, 0, (0.5, 0.5, 0.5)))

LAB = """
from typing import Any

from msgspec import Struct


class Ends(Struct):
    first: int = 0


def ends(population, rng, parameters: Ends):
    return parameters.first, len(population) - 1


def smallest(population, count, rng, parameters):
    places = sorted(range(len(population)), key=lambda at: population[at].size)
    return places[:count]


def text(population, rng, parameters: Any):
    return "ab"


class Forgetful:
    def select(self, population, count, rng):
        return range(count)


class Mindful(Forgetful):
    Parameters = Ends

    def update(self, brood):
        pass
"""

ANSWERS = {
    "return 0, 0": r"must return 2 different whole numbers from 0 to 1, got \(0, 0\)",
    "return 0, 2": r"must return 2 different .* from 0 to 1, got \(0, 2\)",
    "return -1, 0": r"must return 2 different .* got \(-1, 0\)",
    "return (0,)": r"must return 2 different .* got \(0,\)",
    "return 0.0, 1.0": r"must return 2 different .* got \(0\.0, 1\.0\)",
    "return None": "must return 2 different .* got None",
    "return 'ab'": "must return 2 different .* got 'ab'",
    "return population[5], 1": r"raised IndexError: .* \(NAME.py:3\)",
    "return rng.choice(2, 2) + open('no').read()": "raised FileNotFoundError",
    "population[0].measures['height'] = 1.0; return 0, 1": "raised TypeError: .* item",
    "COUNT[0] += 1; return COUNT[0] % 2, 1 - COUNT[0] % 2": (
        r"must keep nothing .* but changes NAME\.COUNT"
    ),
}


@pytest.fixture
def lab(own_module: Callable[[str], str]) -> Callable[[str], str]:
    return own_module


def population(*sizes: int) -> list[Individual]:
    return [
        Individual(BirthId(0, number), CORE, number / 10, 1, 0, size=size)
        for number, size in enumerate(sizes)
    ]


def chain(genome: bytes) -> Robot:
    """Return a core and bricks, as many parts as the genome has bytes."""
    bricks = (Part("FixedBrick", at, 1, 0, 0, ()) for at in range(len(genome) - 1))
    return Robot((Part("Core", -1, -1, -1, 0, ()), *bricks))


GRID = Grid(measures=("limbs", "size"), bounds=((0, 3), (0, 5)), bins=(4, 4))


def with_rules(section: RuleSection) -> Experiment:
    measures = Measures(names=GRID.measures)
    document = Experiment("test", measures=measures, grid=GRID)
    if isinstance(section, Migration):
        return structs.replace(document, migration=section)
    return structs.replace(document, selection=section)


def rule_of(section: RuleSection, name: str) -> Rule:
    return island_rules.rule_of(with_rules(section), name, Relatives(chain))


def check_rule(rule: Rule) -> str:
    return check_rule_of(lambda _: rule, Experiment("test"))


@pytest.mark.parametrize(
    ("name", "rule"),
    [*(("parents", at) for at in PARENTS), *(("survivors", at) for at in SURVIVORS)],
)
def test_built_in_rules_keep_their_contract(name: str, rule: str) -> None:
    # A tournament of one draws from any population.
    section = structs.replace(SelectionSection(tournament_size=1), **{name: rule})
    if rule == "nsga2":
        objectives = {"objectives": {"fitness": "max", "size": "min"}}
        section = structs.replace(section, **{f"{name}_parameters": objectives})

    def make(relatives: Relatives) -> Rule:
        built_in = island_rules.rule_of(with_rules(section), name, relatives)
        return replace(built_in, relatives=relatives)

    check_rule_of(make, Experiment("test"))


def test_own_parents_get_their_parameters(lab: Callable[[str], str]) -> None:
    path = f"{lab(LAB)}:ends"
    selection = SelectionSection(parents=path, parents_parameters={"first": 2})
    rule = rule_of(selection, "parents")
    living = population(3, 3, 3, 3, 3)
    assert rule.places(2, living, np.random.default_rng(0)) == [2, 4]


@pytest.mark.parametrize(
    "answer",
    [
        "range(1, 3)",
        "(1, 2)",
        "np.arange(1, 3)",
        "(np.int32(1), np.uint8(2))",
        "__import__('array').array('i', [1, 2])",
        "__import__('collections').deque((1, 2))",
    ],
)
def test_any_sequence_of_places_is_an_answer(
    answer: str, lab: Callable[[str], str]
) -> None:
    text = (
        f"import numpy as np\ndef some(population, count, rng, _):\n    return {answer}"
    )
    selection = SelectionSection(population=2, survivors=f"{lab(text)}:some")
    everybody = population(9, 5, 7, 4)
    rng = np.random.default_rng(0)
    rule = rule_of(selection, "survivors")
    chosen = select_survivors((), everybody, rng, selection, rule)
    assert chosen == tuple(everybody[1:3])


@pytest.mark.parametrize(
    "answer", ["{1, 2}", "'12'", "b'12'", "range(1, 4)", "(1.0, 2.0)", "iter((1, 2))"]
)
def test_other_answers_are_refused_in_one_line(
    answer: str, lab: Callable[[str], str]
) -> None:
    text = f"def some(population, count, rng, _):\n    return {answer}"
    selection = SelectionSection(population=2, survivors=f"{lab(text)}:some")
    everybody = population(9, 5, 7, 4)
    rng = np.random.default_rng(0)
    with pytest.raises(ExperimentError, match="must return 2 different whole numbers"):
        select_survivors((), everybody, rng, selection, rule_of(selection, "survivors"))


def rules(lab: Callable[[str], str], change: str) -> tuple[Rule, Rule]:
    """Return rules that change their population and choose its first places."""
    name = lab(
        f"def mate(population, rng, parameters):\n    {change}\n    return 0, 1\n"
        f"def live(population, count, rng, parameters):\n    {change}\n"
        "    return list(range(count))\n"
    )
    parents = rule_of(SelectionSection(parents=f"{name}:mate"), "parents")
    return parents, rule_of(SelectionSection(survivors=f"{name}:live"), "survivors")


def test_rule_that_replaces_individuals_is_refused(lab: Callable[[str], str]) -> None:
    parents, survivors = rules(lab, "population[0] = population[-1]")
    everybody, rng = population(9, 5, 7, 4), np.random.default_rng(0)
    for call in (
        lambda: check_rule(parents),
        lambda: check_rule(survivors),
        lambda: parents.places(2, everybody, rng),
        lambda: select_survivors(
            everybody[:2], everybody[2:], rng, SelectionSection(population=2), survivors
        ),
    ):
        with pytest.raises(ExperimentError, match=r"\.py:\d: must not replace"):
            call()


def test_rule_that_sorts_its_list_chooses_from_the_sorted_one(
    lab: Callable[[str], str],
) -> None:
    parents, survivors = rules(lab, "population.sort(key=lambda one: one.size)")
    check_rule(parents)
    check_rule(survivors)
    everybody, rng = tuple(population(9, 5, 7, 4)), np.random.default_rng(0)
    # Of sizes 9, 5, 7 and 4 the smallest are 4 and 5.
    assert parents.places(2, everybody, rng) == [3, 1]
    two = SelectionSection(population=2)
    chosen = select_survivors(everybody[:2], everybody[2:], rng, two, survivors)
    assert chosen == (everybody[1], everybody[3])


@pytest.mark.parametrize("answer", ANSWERS)
def test_bad_rule_is_refused_with_file_and_line(
    lab: Callable[[str], str], answer: str
) -> None:
    name = lab(f"COUNT = [0]\ndef rule(population, rng, parameters):\n    {answer}\n")
    rule = rule_of(SelectionSection(parents=f"{name}:rule"), "parents")
    expected = ANSWERS[answer].replace("NAME", name)
    with pytest.raises(ExperimentError) as caught:
        check_rule(rule)
    message = str(caught.value)
    assert re.search(expected, message), message


def test_survivors_of_wrong_number_are_refused(lab: Callable[[str], str]) -> None:
    name = lab("def few(population, count, rng, parameters):\n    return [0, 1]\n")
    rule = rule_of(SelectionSection(survivors=f"{name}:few"), "survivors")
    expected = rf"survivors: {name}\.py:1: must return 15 different .* 0 to 15, got \[0"
    with pytest.raises(ExperimentError, match=expected):
        check_rule(rule)


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ('parents = "NAME:endz"', r"has no 'endz'; did you mean 'NAME:ends'\?"),
        ('parents = "NAME:smallest"', "must take 3 arguments"),
        ('survivors = "NAME:ends"', "must take 4 arguments"),
        (
            'parents = "NAME:ends"\nparents_parameters = {frist = 1}',
            r"parents_parameters\.frist: no such key; did you mean 'first'",
        ),
        (
            'parents = "NAME:text"\nparents_parameters = {a = 1}',
            r"NAME\.py:20: must annotate its last argument with a msgspec Struct",
        ),
        ("parents_parameters = {a = 1}", "'tournament' has no parameters"),
        (
            'parents = "NAME:Forgetful"',
            "'NAME:Forgetful' has no 'update'",
        ),
        (
            'parents = "NAME:Mindful"\nparents_parameters = {frist = 1}',
            r"parents_parameters\.frist: no such key; did you mean 'first'",
        ),
        (
            'survivors = "NAME:Mindful"\nsurvivors_parameters = {first = "a"}',
            r"survivors_parameters\.first: must be a whole number, got 'a'",
        ),
        ('survivors = "bets"', "'bets'; did you mean 'best'"),
    ],
)
def test_experiment_with_a_bad_rule_is_refused(
    lab: Callable[[str], str], keys: str, expected: str
) -> None:
    name = lab(LAB)
    text = f'name = "x"\n[selection]\n{keys.replace("NAME", name)}\n'
    with pytest.raises(ExperimentError, match=expected.replace("NAME", name)):
        parse_experiment(text, "x.toml")


def test_module_that_is_not_allowed_is_refused() -> None:
    with pytest.raises(UnknownPlugin, match="is not allowed"):
        rule_of(SelectionSection(parents="no_lab:rule"), "parents")


NOVELTY = """
ARCHIVE = []
SIZES = {"least": 0}


class Novelty:
    shared = []

    def __init__(self, parameters):
        self.archive = []

    def select(self, population, count, rng):
        order = sorted(range(len(population)), key=lambda at: self.far(population[at]))
        SELECT
        return order[-count:]

    def far(self, one):
        return min((abs(one.fitness - at) for at in self.archive), default=one.fitness)

    def update(self, brood):
        UPDATE


def novel(population, count, rng, parameters, seen=[]):
    order = sorted(range(len(population)), key=lambda at: population[at].fitness)
    SELECT
    return order[-count:]
"""


def check_new(section: RuleSection, name: str) -> str:
    make = partial(island_rules.rule_of, with_rules(section), name)
    return check_rule_of(make, Experiment("test"))


@pytest.mark.parametrize(
    ("archive", "expected"),
    [
        ("return {one.birth.name: one for one in population}", ""),
        (
            "return {'0': population[0].birth}",
            "archive: must return individuals by texts",
        ),
        ("return {0: population[0]}", "archive: must return individuals by texts"),
        ("return 3", "raised TypeError"),
        ("self.first = population[0]; return {}", "must not write in select"),
    ],
)
def test_archive_of_an_own_rule_is_checked(
    lab: Callable[[str], str], archive: str, expected: str
) -> None:
    methods = (
        "\n    def __init__(self, parameters):\n        pass\n"
        f"\n    def archive(self, population):\n        {archive}\n"
    )
    path = f"{lab(LAB + methods)}:Mindful"
    section = SelectionSection(survivors=path)
    if not expected:
        assert not check_new(section, "survivors")
        return
    with pytest.raises(ExperimentError, match=expected):
        check_new(section, "survivors")


@pytest.mark.parametrize(
    ("kept", "expected"), [(5, ""), (4, "must return at least 5 different")]
)
def test_a_rule_that_varies_keeps_as_many_as_it_likes(
    lab: Callable[[str], str], kept: int, expected: str
) -> None:
    few = (
        "\n    varies = True\n    def __init__(self, parameters):\n        pass\n"
        "\n    def select(self, population, count, rng):\n"
        f"        return range({kept})\n"
    )
    section = SelectionSection(survivors=f"{lab(LAB + few)}:Mindful")
    if not expected:
        assert not check_new(section, "survivors")
        return
    with pytest.raises(ExperimentError, match=expected):
        check_new(section, "survivors")


KEEPS = "self.archive += [one.fitness for one in brood]"


def novelty(lab: Callable[[str], str], select: str, update: str, rule: str) -> str:
    """Return the fault of a rule that does something in its methods, or nothing."""
    text = NOVELTY.replace("SELECT", select).replace("UPDATE", update)
    section = SelectionSection(survivors=f"{lab(text)}:{rule}")
    try:
        check_new(section, "survivors")
    except ExperimentError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(
    ("select", "update", "fault"),
    [
        ("pass", KEEPS, ""),
        ("population[0].robot, population[0].ancestors()", KEEPS, ""),
        (KEEPS.replace("brood", "population"), "pass", r"in select.* self\.archive$"),
        ("self.last = population", KEEPS, r"in select, .* but changes self\.last$"),
        ("pass", "ARCHIVE.extend(brood)", r"in self, .* but changes \w+\.ARCHIVE$"),
        ("pass", "SIZES['least'] += 1", r"in self, .* but changes \w+\.SIZES$"),
        ("pass", "self.shared.append(1)", r"in self, .* but changes \w+\.Novelty$"),
        ("pass", "self.archive.extend(brod)", r"raised NameError: .* \(\w+\.py:\d+\)$"),
    ],
)
def test_memory_is_in_the_object_and_only_update_writes(
    lab: Callable[[str], str], select: str, update: str, fault: str
) -> None:
    found = novelty(lab, select, update, "Novelty")
    assert re.search(fault or "^$", found)
    assert "\n" not in found


@pytest.mark.parametrize(
    ("select", "changed"),
    [
        ("ARCHIVE.append(population[0])", "ARCHIVE"),
        ("SIZES['least'] = len(population)", "SIZES"),
        ("seen.append(1)", "novel"),
    ],
)
def test_function_that_remembers_is_refused(
    lab: Callable[[str], str], select: str, changed: str
) -> None:
    found = novelty(lab, select, "pass", "novel")
    assert re.search(rf"must keep nothing .* but changes \w+\.{changed}$", found)


HIDDEN = """
import not_allowed as elsewhere

class Rule:
    def __init__(self, parameters):
        self.count = 0
    def select(self, population, count, rng):
        first = ({select}) % (len(population) - count + 1)
        return range(first, first + count)
    def update(self, brood):
        self.count += {update}
"""


@pytest.mark.parametrize(
    ("select", "update", "fault"),
    [
        ("next(elsewhere.hidden)", "1", "must return the same twice"),
        ("self.count", "next(elsewhere.hidden)", "as if there were no other"),
        ("self.count", "len(brood)", ""),
    ],
)
def test_memory_that_is_hidden_in_another_package_shows_in_the_answers(
    lab: Callable[[str], str],
    monkeypatch: pytest.MonkeyPatch,
    select: str,
    update: str,
    fault: str,
) -> None:
    elsewhere = ModuleType("not_allowed")
    vars(elsewhere).update(hidden=count())
    monkeypatch.setitem(sys.modules, "not_allowed", elsewhere)
    text = HIDDEN.format(select=select, update=update)
    section = SelectionSection(parents=f"{lab(text)}:Rule")
    with pytest.raises(ExperimentError, match=fault) if fault else nullcontext():
        check_new(section, "parents")


ARCHIVIST = """
from msgspec import Struct


class Archivist:
    class Parameters(Struct):
        most: int = 2

    def __init__(self, parameters):
        self.archive, self.parameters = [], parameters

    def select(self, population, count, rng):
        order = range(len(population))
        far = [one.distances(self.archive).sum() for one in population]
        return sorted(order, key=far.__getitem__)[-count:]

    def update(self, brood):
        self.archive = (self.archive + list(brood))[-self.parameters.most:]
"""


@pytest.mark.parametrize("name", ["parents", "survivors", "emigrants"])
def test_one_class_selects_all_by_distance_of_bodies(
    lab: Callable[[str], str], name: str
) -> None:
    section: RuleSection = Migration() if name == "emigrants" else SelectionSection()
    section = structs.replace(section, **{name: f"{lab(ARCHIVIST)}:Archivist"})
    assert not check_new(section, name)
    # Chains of 3 to 7 parts; to the last two, of 4 and 3, those of 7 are farthest.
    rule = rule_of(section, name)
    sizes = [3, 7, 5, 7, 4, 3]
    everybody = [
        structs.replace(one, genome=b"." * one.size, parents=(BirthId(9, one.size),))
        for one in population(*sizes)
    ]
    rule.update(everybody[:4])
    rule.update(everybody)
    assert rule.places(2, everybody, np.random.default_rng(0)) == [1, 3]


def test_ancestors_of_those_that_have_lived_on_the_island() -> None:
    relatives = Relatives(chain)
    births = [BirthId(0, number) for number in range(5)]
    # 0 and 1 are founders; 9:9 is an immigrant, whose parent never lived here.
    stranger, unknown = BirthId(9, 9), BirthId(9, 1)
    parents = [(), (), tuple(births[:2]), (births[2], stranger), (births[3], births[0])]
    living = [
        Individual(birth, b"...", 0.0, 1, 0, parents=known)
        for birth, known in [*zip(births, parents, strict=True), (stranger, (unknown,))]
    ]
    last = relatives.members(living)[4]
    assert last.ancestors(1) == {births[3], births[0]}
    assert last.ancestors(2) == {births[3], births[0], births[2], stranger}
    assert last.ancestors() == {*births[:4], stranger, unknown}
    assert not last.ancestors(0)
    assert relatives.members(living).index(last) == 4
    assert not hasattr(last, "__dict__")  # so nothing of it can be set
