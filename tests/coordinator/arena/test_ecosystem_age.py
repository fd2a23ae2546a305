"""Test of what a robot pays in an ecosystem that is younger than the last decision."""

import numpy as np
import pytest

from coordinator.arena.ecosystem import ENERGY, RESTS_UNTIL, Ecosystem, EcosystemRules
from schema.experiment.file import read_experiment
from schema.plugins.arena_rules import ArenaView, Resident
from schema.robot.ids import BirthId


def test_a_robot_pays_only_for_the_time_that_it_has_lived() -> None:
    # The first decision is after 30 s; the robot is 4 s old.
    rules = EcosystemRules(read_experiment("ecosystem"), Ecosystem(patches=0))
    stores = {ENERGY: 20.0, RESTS_UNTIL: 0.0}
    track, name = np.zeros((1, 2), np.float32), BirthId(0, 3)
    robot = Resident(name, (), 4.0, (0.0, 0.0), track, 0.5, None, {}, 1, False, stores)
    view = ArenaView(30.0, 30.0, 30, 30, True, True, (robot,), (), ())
    decided = rules.decide(view, np.random.default_rng(1))
    assert decided.stores[name][ENERGY] == pytest.approx(20.0 - 4.0 * 0.1 - 0.5 * 2.0)
