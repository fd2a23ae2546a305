"""Identities and settings of evaluations, and what two of them have in common."""

from typing import Any

from msgspec.structs import replace

from schema.experiment.document import Fitness, Simulation, Space
from schema.experiment.identity import Identity, Origin
from schema.experiment.settings import EvaluationSettings
from schema.robot.ids import BirthId
from schema.robot.trace import Trace

ORIGIN = Origin(seed=7, run=1, island=2)
IDENTITY = Identity(ORIGIN, BirthId(2, 5), 0)
OTHERS = (
    Identity(replace(ORIGIN, seed=8), BirthId(2, 5), 0),
    Identity(replace(ORIGIN, run=2), BirthId(2, 5), 0),
    Identity(replace(ORIGIN, island=3), BirthId(2, 5), 0),
    Identity(ORIGIN, BirthId(3, 5), 0),
    Identity(ORIGIN, BirthId(2, 6), 0),
    Identity(ORIGIN, BirthId(2, 5), 1),
)


def with_simulation(
    simulation: Simulation,
    **rest: Any,  # noqa: ANN401 - any further settings
) -> EvaluationSettings:
    settings = {"space": Space(), "fitness": Fitness(), **rest}
    return EvaluationSettings(simulation=simulation, **settings)


def bits(track: Trace) -> bytes:
    return track.core_position.tobytes()
