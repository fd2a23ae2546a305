"""The comparison of learners on fixed bodies: its data, and one search again."""

import csv

import pytest

from docs.learners_campaign import (
    BODIES,
    BUDGET,
    DATA,
    LEARNERS,
    SEEDS,
    SETS,
    courses,
    lines,
    search,
)
from schema.robot.ids import BirthId

PAGE = DATA.parent / "learning.md"
FIRST_GENERATION = 6


def test_the_page_has_the_table_of_the_data() -> None:
    assert {*courses()} == {(name, each) for name in SETS for each in LEARNERS}
    assert "\n".join(lines()) in PAGE.read_text("utf-8")


def test_all_searches_of_a_body_begin_alike_and_never_get_worse() -> None:
    for found in courses().values():
        assert found.shape == (SEEDS, BODIES, BUDGET)
        assert (found[:, :, 0] == found[:1, :, 0]).all()
        assert (found[:, :, 1:] >= found[:, :, :-1]).all()


@pytest.mark.long
@pytest.mark.parametrize("learner", LEARNERS)
def test_a_search_gives_its_row_again(learner: str) -> None:
    """Within the last digits of another machine; 60 evaluations of 4 s.

    Eigenvectors differ between processors, and with them all generations of ``cma-es``
    but the first.
    """
    trials = FIRST_GENERATION if learner.startswith("cma-es") else BUDGET
    with (DATA / "random.csv").open(newline="") as file:
        row = next(each for each in csv.DictReader(file) if each["learner"] == learner)
    robot = SETS["random"](BODIES)[int(row["body"])]
    name, seed = BirthId(0, int(row["body"])), int(row["seed"])
    found = search(robot, LEARNERS[learner], name, seed, trials)
    wanted = [float(row[f"best_{trial}"]) for trial in range(trials)]
    assert found == pytest.approx(wanted, rel=1e-6)
