"""Tests of the simulation that a gait is rendered from."""

import json
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest

from analysis.figures.family_tree import Best
from analysis.figures.robot_pictures import robot_picture, shown_experiment
from analysis.measures.families import family
from analysis.measures.load import LoadedRun
from coordinator.evolution.generation import generate
from schema.errors import SimulationDiverged
from schema.experiment.document import Experiment, Islands
from schema.experiment.file import experiment_from_text
from schema.experiment.identity import NO_IDENTITY, Identity, Origin
from schema.robot.ids import BirthId
from schema.wire.genome_bytes import encode_genome
from tests.analysis.bodies import part
from tests.analysis.tables import births

EXPERIMENT = Experiment(name="x", islands=(Islands(count=3),))


def test_gait_uses_noise_of_the_run_and_the_island_of_the_fitness() -> None:
    asked: list[Identity] = []

    def simulate(
        *_: object, identity: Identity = NO_IDENTITY, **__: object
    ) -> NoReturn:
        asked.append(identity)
        raise SimulationDiverged("not simulated here")

    genome = generate(np.random.default_rng(1), EXPERIMENT, BirthId(2, 4))
    members = births(
        ((2, 4), []), genome=[encode_genome(genome)], body=[[part(0, -1, -1, "Core")]]
    )
    with pytest.raises(SimulationDiverged):
        robot_picture(
            Best("x", Path("f"), 1, 2, 4, 0.1),
            members,
            family(members, 0),
            EXPERIMENT,
            simulate,
            origin=Origin(seed=7, run=3),
            has_family=False,
        )
    origin = Origin(seed=7, run=3, island=1)
    assert asked == [Identity(origin, BirthId(2, 4), 0)]


def test_pictures_need_no_plug_in_that_only_judges() -> None:
    fitness = {"function": "goals:fast"}
    document = {
        "name": "x",
        "fitness": fitness,
        "measures": {"names": ["goals:length"]},
        "selection": {"parents": "goals:pick"},
        "environment": {"friction": 0.7},
        "islands": [{"fitness": fitness}, {}],
    }
    text = json.dumps(document)
    # The folder, which would have the sources, does not exist.
    run = LoadedRun(Path("f"), "x", 0, 1, "finished", text, EXPERIMENT)
    shown = shown_experiment(run)
    plain = {key: document[key] for key in ("name", "environment")}
    read = experiment_from_text(json.dumps({**plain, "islands": [{}, {}]}))
    assert shown == read
