"""Phylogenies of runs, against hand-worked ones and a reader of the standard."""

import io
import math
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import csv

from analysis.measures.ancestry import phylogeny
from revolve.campaign import Runs
from schema.errors import RunFolderError
from tests.analysis.campaign import BROODS, FOUNDERS, random_bodies, write_run
from tests.analysis.tables import births, population

A, B, C, D, E = (0, 0), (0, 1), (1, 0), (0, 2), (1, 1)


def test_migrants_and_the_dead_of_two_islands() -> None:
    """C migrates to island 0 and dies there last; D is never in a population."""
    born = births((A, []), (B, []), (D, [B, C]), (C, []), (E, [C, D]),
                  rank=[1, 1, 2, 1, 3])  # fmt: skip
    living = population(
        (0, 2, {A: 1.0, B: 2.0}),
        (0, 3, {B: 2.0, C: 3.0}),
        (0, 4, {B: 2.0}),
        (1, 1, {C: 3.0}),
        (1, 2, {E: None}),
    )
    rows = phylogeny(born, living, 10).to_pylist()
    assert [(row["island"], row["origin_time"]) for row in rows] == [A, B, C, D, E]
    assert [row["id"] for row in rows] == [10, 11, 12, 13, 14]
    assert [row["ancestor_list"] for row in rows] == [
        "[none]", "[none]", "[none]", "[11, 12]", "[12, 13]",
    ]  # fmt: skip
    # C is gone on island 1 at 2 births, and on island 0, where it was copied to, at 4.
    ends = [row["destruction_time"] for row in rows]
    assert ends == [3.0, math.inf, 4.0, 3.0, math.inf]


def test_a_parent_that_is_not_recorded_is_an_error() -> None:
    born = births((B, [A]), (D, [A, B]), rank=[2, 3])
    with pytest.raises(RunFolderError, match="parent"):
        phylogeny(born, population())


def test_individuals_without_a_population_live_on() -> None:
    found = phylogeny(births((A, []), (B, [A]), rank=[1, 2]), population()).to_pydict()
    assert found["ancestor_list"] == ["[none]", "[0]"]
    assert found["destruction_time"] == [math.inf, math.inf]


@pytest.mark.long
def test_a_reader_of_the_standard_finds_the_same_ancestry(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    reader = pytest.importorskip("phyloframe.legacy")
    bodies = pa.array(random_bodies(np.random.default_rng(1), 90))
    made = 0
    for experiment in BROODS:
        write_run(tmp_path / experiment, experiment, made, 90, bodies)
        made += 1
    runs, file = Runs(tmp_path), io.BytesIO()
    csv.write_csv(runs.phylogeny(), file)
    file.seek(0)
    frame = pandas.read_csv(file)
    assert reader.alifestd_validate(frame)
    assert reader.alifestd_is_topologically_sorted(frame)
    assert not reader.alifestd_is_asexual(frame)
    # One experiment has no reproduction: all of its robots are roots.
    roots = set(reader.alifestd_find_root_ids(frame))
    assert len(roots) == (made - 1) * FOUNDERS + 90
    names = ["experiment", "island", "origin_time"]
    keys = frame[names].itertuples(index=False, name=None)
    ids = dict(zip(keys, frame["id"], strict=True))
    lists = dict(zip(frame["id"], frame["ancestor_list"], strict=True))
    for row in runs.births.to_pylist():
        name = row["experiment"]
        wanted = [ids[name, each["island"], each["birth"]] for each in row["parents"]]
        own = ids[name, row["island"], row["birth"]]
        assert reader.alifestd_parse_ancestor_ids(lists[own]) == wanted
    gone = frame["destruction_time"]
    assert (gone > frame["origin_time"]).all()
    living = runs.population.to_pylist()
    last = {row["experiment"]: row["births"] for row in living}
    alive = sum(row["births"] == last[row["experiment"]] for row in living)
    assert np.isinf(gone).sum() == alive
