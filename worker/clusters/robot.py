"""A robot that lives in an arena: its seat, its mind, its window, its name."""

from dataclasses import dataclass

import numpy as np

from schema.parts import Vector
from schema.robot.ids import BirthId
from schema.robot.results import Floats
from schema.robot.robot import Robot
from worker.clusters.engine_view import EngineView
from worker.clusters.models import Body
from worker.clusters.window import Window
from worker.robot.controller import Network


@dataclass(slots=True)
class ArenaRobot:
    """A living robot; all that an arena knows of it.

    Attributes:
        birth: who.
        robot: its body and its present brain.
        encoded: the robot's bytes, for snapshots.
        body: it as the engine knows it.
        view: where its state is now.
        network: its brain as arrays.
        states: (S,) of its neurons after the last tick; a row of the bank.
        thinks_since: step from which its brain's clock counts.
        window: where it was lately.
        place: of the core's centre at the last sample, world frame [m].
    """

    birth: BirthId
    robot: Robot
    encoded: bytes
    body: Body
    view: EngineView
    network: Network
    states: Floats
    thinks_since: int
    window: Window
    place: Vector


def put(view: EngineView, place: Vector, heading: float) -> None:
    """Move a robot at neutral pose to a place.

    Args:
        view: where its state is.
        place: for the core's centre, world frame [m].
        heading: turn about z [rad].
    """
    view.qpos[:3] = place
    if heading:
        view.qpos[3:7] = np.cos(0.5 * heading), 0.0, 0.0, np.sin(0.5 * heading)
