"""Pushes have the impulse of the experiment and directions of the identity."""

import mujoco
import numpy as np
import pytest

from schema.experiment.document import Fitness, Simulation, Space, body_space
from schema.experiment.environment import FLAT, Environment
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.experiment.settings import EvaluationSettings
from schema.mjcf.model import solo_spec
from schema.robot.brain import INPUT, Brain, Neuron
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.robot.trace import Floats
from tests.worker.evaluations import IDENTITY, ORIGIN, OTHERS
from worker.robot.evaluation import simulate

CORE = Robot(
    (Part("Core", -1, -1, -1, 0, (0.5, 0.5, 0.5)),),
    Brain(tuple(Neuron("input", INPUT, 0) for _ in range(6))),
)
WEIGHTLESS = Simulation(gravity=0.0, drop_m=1.0, window_steps=400)
PUSHED = Environment(push_impulse=0.03, push_interval_s=0.5)


def velocities(
    identity: Identity,
    environment: Environment = PUSHED,
    simulation: Simulation = WEIGHTLESS,
) -> Floats:
    """Return a core's linear velocity at each tick of 0.125 s, (T, 3) [m/s]."""
    settings = EvaluationSettings(
        space=Space(), simulation=simulation, fitness=Fitness(), environment=environment
    )
    found: list[Floats] = []
    simulate(
        CORE,
        settings,
        watch=lambda data: found.append(data.qvel[:3].copy()),
        identity=identity,
    )
    return np.array(found)


def core_mass() -> float:
    model = solo_spec(CORE, body_space(Space()), WEIGHTLESS, FLAT).compile()
    return float(mujoco.mj_getTotalmass(model))


def test_each_push_changes_the_momentum_by_its_impulse() -> None:
    """Pushes begin at ticks 4, 8 and 12 and last one tick each."""
    found = velocities(IDENTITY)
    changes = np.diff(found, axis=0)
    sizes = np.linalg.norm(changes, axis=1) * core_mass()
    expected = np.zeros(len(sizes))
    expected[[4, 8, 12]] = 0.03
    assert sizes == pytest.approx(expected, abs=1e-9)
    assert np.abs(found[:, 2]).max() < 1e-12
    first, second, third = changes[[4, 8, 12], :2].tolist()
    assert first != pytest.approx(second)
    assert second != pytest.approx(third)


def test_directions_are_uniform() -> None:
    turns = []
    for number in range(40):
        identity = Identity(ORIGIN, BirthId(0, number), 0)
        x, y = velocities(identity)[5, :2].tolist()
        turns.append(np.arctan2(y, x) / (2.0 * np.pi) % 1.0)
    counts, _ = np.histogram(turns, bins=4, range=(0.0, 1.0))
    # Four quarters of 40: mean 10, standard deviation 2.7.
    assert counts.min() >= 3


def test_pushes_depend_on_the_identity_only() -> None:
    first = velocities(IDENTITY)
    assert velocities(IDENTITY).tobytes() == first.tobytes()
    for other in OTHERS:
        assert velocities(other).tobytes() != first.tobytes()


def test_without_impulse_there_are_no_pushes() -> None:
    still = Environment(push_interval_s=0.5)
    assert not velocities(IDENTITY, still).any()
    assert not velocities(NO_IDENTITY, still).any()
