"""Tests of the simulation that a gait is rendered from."""

import json
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest

from analysis.figures.family_tree import Best
from analysis.figures.robot_pictures import robot_picture, shown_document
from analysis.measures.families import family
from coordinator.evolution.generation import generate
from schema.errors import SimulationDiverged
from schema.experiment.document import Experiment, Islands
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
        "space": {"part_types": ["goals:PART"]},
        "islands": [{"fitness": fitness, "births": 3}],
    }
    assert json.loads(shown_document(json.dumps(document))) == {
        "name": "x",
        "space": {"part_types": ["goals:PART"]},
        "islands": [{"births": 3}],
    }
