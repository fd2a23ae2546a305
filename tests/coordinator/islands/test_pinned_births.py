"""Births of one seed, as they were when they were last meant to change."""

from hashlib import sha256
from typing import Any

import pytest
from msgspec.structs import replace

from schema.experiment.document import (
    BrainSection,
    EncodingSection,
    Experiment,
    Generation,
    Islands,
    Space,
    Variation,
)
from schema.experiment.file import read_experiment
from schema.experiment.learning import Learning
from schema.experiment.migration import Migration
from tests.coordinator.archipelago_run import ArchipelagoRun
from tests.coordinator.breeding import reject_some


def shipped(name: str, births: int, **changes: Any) -> Experiment:  # noqa: ANN401 - any setting
    return replace(read_experiment(name), births=births, **changes)


WILD = Variation(
    p_delete_subtree=0.9, p_duplicate_subtree=0.2, p_swap_subtree=0.5,
    p_delete_hidden_neuron=0.3, p_remove_brain_connection=0.2,
    body_epsilon=0.3, brain_epsilon=0.3,
)  # fmt: skip
CASES = {
    "thesis": shipped("scenario1", 90),
    "cpg": shipped("scenario1", 60, brain=BrainSection(type="cpg")),
    "cppn": shipped("scenario1", 40, encoding=EncodingSection(type="cppn")),
    "wild": shipped(
        "scenario1",
        90,
        variation=WILD,
        space=Space(planar=False, max_parts=14),
        generation=Generation(parts_mean=9.0, p_connect_neurons=0.3),
    ),
    "bridge": shipped("bridge", 60),
    "learning": shipped(
        "scenario1",
        40,
        learning=Learning(learner="(1+1)-es", budget=4, inherit="lamarckian"),
    ),
    "arena": shipped("scenario3", 40),
    "islands": Experiment(
        name="islands",
        islands=(
            Islands(count=2, births=45),
            Islands(births=30, arena=read_experiment("scenario3").arena),
        ),
        migration=Migration(
            topology="small-world",
            degree=2,
            epoch=15,
            migrants=2,
            emigrants="tournament",
            replaced="random",
        ),
    ),
}
PINNED = {
    "thesis": "dd1d118d35af8277",
    "cpg": "4e1b96b53be594b4",
    "cppn": "16081e7da3b59f9b",
    "wild": "5f136843e18de4db",
    "bridge": "fcca91b74c65a2a4",
    "learning": "9ca6f2812e010b29",
    "arena": "5d9c475e5aa7b8c1",
    "islands": "7665cf5bb74fb862",
}


@pytest.mark.parametrize("case", CASES)
def test_births_of_a_seed_stay_the_same(case: str) -> None:
    lived = ArchipelagoRun(CASES[case], seed=7, run=1, verdict=reject_some).live()
    digest = sha256()
    for table in ("births", "population", "deaths", "migrations", "learning"):
        for row in lived.rows(table):
            new = ("origin", "sample_")
            known = [each for each in row.items() if not each[0].startswith(new)]
            digest.update(repr(sorted(known)).encode())
    assert digest.hexdigest()[:16] == PINNED[case]
