"""Own rules of selection: what they get, and how bad answers are refused."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from coordinator.evolution.breeding import Individual
from coordinator.evolution.kinds import check_rule
from coordinator.evolution.selection import (
    PARENT_RULES,
    SURVIVOR_RULES,
    Rule,
    Tournament,
    rule_of,
    select_parents,
    select_survivors,
)
from schema.errors import ExperimentError, UnknownPlugin
from schema.experiment.document import PARENTS, SURVIVORS, SelectionSection
from schema.plugins import permission
from schema.robot.genome import Node
from schema.robot.ids import BirthId
from tests.documents import parse_experiment

CORE = Node("Core", -1, 0, (0.5, 0.5, 0.5))

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
    "COUNT[0] += 1; return COUNT[0] % 2, 1 - COUNT[0] % 2": "must return the same",
}


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], str]:
    """Return a function that writes and allows a module, and returns its name."""
    monkeypatch.setattr(permission, "_allowed", {})

    def write(text: str) -> str:
        name = f"rules_{tmp_path.name.replace('-', '_')}"
        (tmp_path / f"{name}.py").write_text(text)
        permission.allow([str(tmp_path / f"{name}.py")])
        return name

    return write


def population(*sizes: int) -> list[Individual]:
    return [
        Individual(BirthId(0, number), CORE, number / 10, 1, 0, size=size)
        for number, size in enumerate(sizes)
    ]


def test_built_in_rules_keep_their_contract() -> None:
    # A tournament of one draws from any population.
    check_rule(Rule("selection.parents", PARENT_RULES["tournament"], Tournament(1)))
    check_rule(Rule("selection.parents", PARENT_RULES["random"], None))
    for survivors in SURVIVOR_RULES.values():
        check_rule(Rule("selection.survivors", survivors, None))
    assert {*PARENT_RULES, "none"} == {*PARENTS}
    assert {*SURVIVOR_RULES} == {*SURVIVORS}


def test_own_parents_get_their_parameters(lab: Callable[[str], str]) -> None:
    path = f"{lab(LAB)}:ends"
    selection = SelectionSection(parents=path, parents_parameters={"first": 2})
    rule = rule_of(selection, "parents")
    living = population(3, 3, 3, 3, 3)
    first, second = select_parents(living, np.random.default_rng(0), rule)
    assert (first, second) == (living[2], living[4])


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
        lambda: select_parents(everybody, rng, parents),
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
    couple = select_parents(everybody, rng, parents)
    assert couple == (everybody[3], everybody[1])
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
