"""Given founders on islands of all kinds, against runs of random founders."""

from hashlib import sha256

import pytest
from msgspec.structs import replace

from coordinator.evolution.founders import founders_of
from coordinator.islands.events import Started
from coordinator.islands.island import Island
from schema.errors import ExperimentError
from schema.experiment.document import (
    EncodingSection,
    Experiment,
    FounderGenome,
    Founders,
    Islands,
)
from schema.experiment.file import read_experiment
from schema.experiment.learning import Learning
from schema.tables.description import KeptFounder
from schema.wire.messages import Breed
from tests.coordinator.archipelago_run import ArchipelagoRun
from tests.coordinator.breeding import bred, reject_some

PLAIN = replace(read_experiment("scenario1"), births=40)
ARENA = read_experiment("scenario3").arena
CASES = {
    "off-line": PLAIN,
    "arena": replace(PLAIN, arena=ARENA),
    "learning": replace(PLAIN, learning=Learning(learner="(1+1)-es", budget=2)),
    "islands": replace(PLAIN, islands=(Islands(count=2), Islands(arena=ARENA))),
}
OTHER = Island(PLAIN, 99, 0, 4)
GENOMES = [
    child.genome
    for work in OTHER.handle(Started())[:3]
    if isinstance(work, Breed) and (child := bred(OTHER, work).child)
]
"""Genomes of another run."""
NAMED = tuple(
    FounderGenome(digest=sha256(genome).hexdigest(), island=4, birth=number)
    for number, genome in enumerate(GENOMES)
)
KEPT = {
    named.digest: KeptFounder(genome, run="0123456789ab")
    for named, genome in zip(NAMED, GENOMES, strict=True)
}


def given(experiment: Experiment, *, repeat: bool = False) -> Experiment:
    founders = Founders(repeat=repeat, genomes=NAMED)
    return replace(experiment, founders=founders)


@pytest.mark.parametrize("case", CASES)
def test_given_founders_come_first_and_random_ones_are_those_without(case: str) -> None:
    experiment = CASES[case]
    with_given = ArchipelagoRun(given(experiment), 7, 1, founders=KEPT).live()
    random = ArchipelagoRun(experiment, 7, 1).live()
    rows = {(row["island"], row["birth"]): row for row in random.rows("births")}
    numbers = set()
    for row in with_given.rows("births"):
        number = row["birth"]
        if number >= 15:
            assert row["parents"]
            assert row["origin_digest"] is None
            continue
        assert (row["rank"], row["parents"], row["attempts"]) == (1, [], 1)
        if number < 3:
            numbers.add((row["island"], number))
            assert row["genome"] == GENOMES[number]
            assert row["origin_digest"] == NAMED[number].digest
            assert (row["origin_island"], row["origin_birth"]) == (4, number)
            assert (row["origin_run"], row["origin_file"]) == ("0123456789ab", None)
        else:
            assert row["genome"] == rows[row["island"], number]["genome"]
            assert row["origin_run"] is row["origin_birth"] is None
    assert numbers == {(island, n) for island in with_given.islands for n in range(3)}


@pytest.mark.parametrize("case", ["off-line", "arena"])
def test_copies_fill_up_in_order(case: str) -> None:
    experiment = given(CASES[case], repeat=True)
    lived = ArchipelagoRun(experiment, 7, 1, founders=KEPT).live()
    genomes = {row["birth"]: row["genome"] for row in lived.rows("births")}
    assert [genomes[n] for n in range(15)] == GENOMES * 5


def test_an_island_may_have_founders_of_its_own() -> None:
    last = Founders(genomes=NAMED[2:])
    islands = (Islands(count=2), Islands(founders=last))
    lived = ArchipelagoRun(
        given(replace(PLAIN, islands=islands)), 7, 1, founders=KEPT
    ).live()
    births = [row["origin_birth"] for row in lived.rows("births") if row["birth"] == 0]
    assert births == [0, 0, 2]


@pytest.mark.parametrize("case", ["off-line", "arena"])
def test_a_given_founder_that_is_refused_is_not_replaced_by_a_random_one(
    case: str,
) -> None:
    run = ArchipelagoRun(given(CASES[case]), 7, 1, verdict=reject_some, founders=KEPT)
    with pytest.raises(ExperimentError, match="birth 1 of island 0: the given fou"):
        run.live()


def test_a_missing_genome_is_refused() -> None:
    kept = {NAMED[0].digest: KEPT[NAMED[0].digest]}
    with pytest.raises(ExperimentError, match=f"{NAMED[1].digest[:12]} is missing"):
        founders_of(given(PLAIN), kept)


def test_genomes_of_other_encodings_are_given_as_they_are() -> None:
    patterns = replace(PLAIN, encoding=EncodingSection(type="cppn"))
    first = ArchipelagoRun(patterns, 8, 0).live().rows("births")[20]
    digest = sha256(first["genome"]).hexdigest()
    founders = Founders(genomes=(FounderGenome(digest=digest, island=0, birth=20),))
    again = ArchipelagoRun(
        replace(patterns, founders=founders),
        9,
        founders={digest: KeptFounder(first["genome"])},
    )
    row = again.live().rows("births")[0]
    assert (row["genome"], row["robot"]) == (first["genome"], first["robot"])
