"""Recording of the channels of a trace that fitness and measures declare.

A sample is one row of numbers, so that a window of them is an array that a snapshot
can hold. Channels that nothing declares have no numbers.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from schema.experiment.document import body_space
from schema.experiment.settings import ArenaSettings, EvaluationSettings
from schema.robot.frames import place_parts, shapes_of
from schema.robot.results import Floats
from schema.robot.robot import Robot
from schema.robot.trace import RECORDED, Trace
from worker.measures.functions import functions_of
from worker.robot.contacts import contact_reader

Indices = npt.NDArray[np.intp]
_FREE, _FREE_DOFS = 7, 6
"""Numbers of a free joint's position and orientation, and of its velocity."""


PROBED = ("joint_torque", "energy", "contact")
"""Channels that are not functions of positions and velocities."""


def probed_channels(settings: EvaluationSettings | ArenaSettings) -> tuple[str, ...]:
    """Return the channels of an experiment that need a probe."""
    wanted = functions_of(settings).channels
    return tuple(name for name in PROBED if name in wanted)


class Channels:
    """Channels of one robot: their places in a row, and those with one value.

    Attributes:
        names: of the recorded channels, in the order of ``RECORDED``.
        width: numbers of a row.
        has_probe: some of them need a probe.
        has_work: the probe must see every step.
        dofs: number of the robot's velocities.
    """

    def __init__(
        self,
        robot: Robot,
        model: mujoco.MjModel,
        settings: EvaluationSettings | ArenaSettings,
    ) -> None:
        """Lay out the channels that an experiment's functions declare.

        Args:
            robot: the robot.
            model: in which it is alone.
            settings: fitness and measures.
        """
        wanted = functions_of(settings).channels
        free = model.joint("free").id
        # Without the free joints of the robot and of objects in scenery.
        joints = int((model.jnt_type != mujoco.mjtJoint.mjJNT_FREE).sum())
        inputs = robot.brain.count("input")
        sizes = {
            "core_attitude": 4,
            "joint_angle": joints,
            "joint_velocity": joints,
            "joint_torque": joints,
            "energy": 1,
            "contact": len(robot.parts),
            "readings": inputs,
            "neighbours": 1,
        }
        self.names = tuple(name for name in RECORDED if name in wanted)
        self._joints, self._inputs = joints, inputs
        self.dofs = _FREE_DOFS + joints
        self._spans: dict[str, slice] = {}
        self.width = 0
        for name in self.names:
            self._spans[name] = slice(self.width, self.width + sizes[name])
            self.width += sizes[name]
        self.has_probe = bool(probed_channels(settings))
        self.has_work = "energy" in wanted
        self._constants: dict[str, Any] = {
            "light": settings.light,
            "mass": float(model.body_subtreemass[model.jnt_bodyid[free]]),
            "gravity": settings.simulation.gravity,
        }
        if "part_position" in wanted:
            shapes = shapes_of(robot, body_space(settings.space))
            self._constants["part_position"] = place_parts(robot, shapes)[1]

    def row(
        self,
        qpos: Floats,
        qvel: Floats,
        *,
        probe: Floats | None,
        readings: Floats,
        neighbours: int,
    ) -> Floats:
        """Return a sample as a row.

        Args:
            qpos: (7 + J,) of the robot, or more.
            qvel: (6 + J,) of the robot, or more.
            probe: ``Probe.numbers``; None if there is no probe.
            readings: (1, I') of its sensors, I' >= I.
            neighbours: number of robots near it.
        """
        row = np.empty(self.width)
        for name, span in self._spans.items():
            if name == "core_attitude":
                row[span] = qpos[3:_FREE]
            elif name == "joint_angle":
                row[span] = qpos[_FREE : _FREE + self._joints]
            elif name == "joint_velocity":
                row[span] = qvel[_FREE_DOFS : _FREE_DOFS + self._joints]
            elif name == "readings":
                row[span] = readings[0, : self._inputs]
            elif name == "neighbours":
                row[span] = neighbours
            else:
                assert probe is not None
                row[span] = probe[self._probed(name)]
        return row

    def _probed(self, name: str) -> slice:
        """Return where the numbers of a probe hold a channel."""
        if name == "energy":
            return slice(0, 1)
        first = 1 + self._joints
        return slice(1, first) if name == "joint_torque" else slice(first, None)

    def trace(
        self,
        robot: Robot,
        interval_s: float,
        positions: Floats,
        rows: Iterable[Floats],
    ) -> Trace:
        """Return the trace of some samples.

        Args:
            robot: the robot with its present brain.
            interval_s: between two samples [s].
            positions: (T, 3) of the core [m].
            rows: of the samples, T of them; none if no channel is recorded.
        """
        constants = self._constants | {"robot": robot}
        if not self.names:
            return Trace(interval_s, positions, constants)
        table = np.array(list(rows)).reshape(len(positions), self.width)
        found: dict[str, Any] = {n: table[:, span] for n, span in self._spans.items()}
        if "energy" in found:
            found["energy"] = found["energy"][:, 0] - found["energy"][0, 0]
        if "contact" in found:
            found["contact"] = found["contact"] != 0.0
        if "neighbours" in found:
            found["neighbours"] = found["neighbours"][:, 0].astype(np.int64)
        return Trace(interval_s, positions, found | constants)


class Probe:
    """Work, torques and contacts of one robot in a model, as of the last step.

    Attributes:
        numbers: (1 + J + P,) work of the motors since birth [J], torque of each joint
            [N m or N], whether each part touches anything but the robot.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        robot: Robot,
        *,
        dofs: slice,
        geoms: tuple[int, int],
        prefix: str = "",
    ) -> None:
        """Find a robot in a model.

        Args:
            model: a compiled model that holds it.
            data: the model's state.
            robot: the robot.
            dofs: its slice of the model's velocities.
            geoms: first and last + 1 of its geoms.
            prefix: of its names in the model.
        """
        self._contacts = contact_reader(model, data)
        self._velocities = data.qvel
        self._timestep_s = float(model.opt.timestep)
        first = dofs.start + _FREE_DOFS
        driven = model.jnt_dofadr[model.actuator_trnid[:, 0]]
        own = ((driven >= first) & (driven < dofs.stop)).nonzero()[0]
        motors = slice(int(own[0]), int(own[-1]) + 1) if len(own) else slice(0, 0)
        self._dofs: Indices = driven[motors].astype(np.intp)
        self._forces: Floats = data.actuator_force[motors]
        self._before: Floats = data.actuator_velocity[motors]
        self._slopes: Floats = model.actuator_biasprm[motors, 2].copy()
        self._limits: Floats = model.actuator_forcerange[motors, 1].copy()
        self._part_of = {
            geom: int(model.geom(geom).name.removeprefix(prefix).partition("/")[0])
            for geom in range(*geoms)
        }
        self._driven = 1 + self._dofs - first
        self._parts = 1 + dofs.stop - first
        self.numbers: Floats = np.zeros(self._parts + len(robot.parts))

    def add_work(self) -> None:
        """Add the work of the step that was just made."""
        now = self._velocities[self._dofs]
        # The integrator moves joints by the velocity after the step.
        power = np.abs(self._torques(now) * now)
        self.numbers[0] += self._timestep_s * float(power.sum())

    def read(self) -> None:
        """Read torques and contacts."""
        part_of, parts = self._part_of, self._parts
        self.numbers[self._driven] = self._torques(self._velocities[self._dofs])
        self.numbers[parts:] = 0.0
        for one, other in self._contacts():
            if (one in part_of) != (other in part_of):
                touching = part_of[one if one in part_of else other]
                self.numbers[parts + touching] = 1.0

    def _torques(self, now: Floats) -> Floats:
        """Return the torques that acted in the last step.

        The integrator is implicit in velocity: a servo that is not at its limit acts
        with the torque of the velocity after the step.

        Args:
            now: velocities of the driven joints after the step.
        """
        torques = self._forces + self._slopes * (now - self._before)
        is_limited = np.abs(self._forces) >= self._limits
        return np.where(is_limited, self._forces, torques)


class SampleRecorder:
    """Rows of one robot that is alone in its model.

    Attributes:
        rows: of the samples.
        readings: (1, I) of its sensors, without noise.
    """

    def __init__(
        self,
        channels: Channels,
        robot: Robot,
        model: mujoco.MjModel,
        data: mujoco.MjData,
    ) -> None:
        """Initialise without samples.

        Args:
            channels: to record.
            robot: the robot.
            model: the model in which it is alone.
            data: the model's state.
        """
        self._model, self._data, self._channels = model, data, channels
        self.rows: list[Floats] = []
        self.readings: Floats = np.zeros((1, 0))
        self._probe: Probe | None = None
        if channels.has_probe:
            root = int(model.jnt_bodyid[model.joint("free").id])
            first = int(model.body_geomadr[root])
            own = int((model.body_rootid[model.geom_bodyid] == root).sum())
            geoms, dofs = (first, first + own), slice(0, channels.dofs)
            self._probe = Probe(model, data, robot, dofs=dofs, geoms=geoms)
        self._working = [self._probe] if self._probe and channels.has_work else []

    def step(self, steps: int) -> None:
        """Step the physics."""
        step_with(self._working, self._model, self._data, steps)

    def sample(self) -> None:
        """Add a sample of the present state."""
        if self._probe is not None:
            self._probe.read()
        row = self._channels.row(
            self._data.qpos,
            self._data.qvel,
            probe=self._probe.numbers if self._probe else None,
            readings=self.readings,
            neighbours=0,
        )
        self.rows.append(row)


def step_with(
    probes: Sequence[Probe], model: mujoco.MjModel, data: mujoco.MjData, steps: int
) -> None:
    """Step the physics with constant commands; probes, if any, see every step."""
    if not probes:
        mujoco.mj_step(model, data, steps)  # by position: a third of a call by name
        return
    for _ in range(steps):
        mujoco.mj_step(model, data)
        for probe in probes:
            probe.add_work()
