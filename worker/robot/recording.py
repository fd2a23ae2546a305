"""Recording of the channels of a trace that fitness and measures declare.

A sample is one row of numbers, so that a window of them is an array that a snapshot
can hold. Channels that nothing declares have no numbers.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from schema.experiment.document import body_space, is_lit
from schema.experiment.settings import ArenaSettings, EvaluationSettings
from schema.robot.frames import place_parts, shapes_of
from schema.robot.robot import Robot
from schema.robot.trace import RECORDED, Floats, Trace
from worker.measures import functions_of
from worker.robot.devices import Sensors, Servos
from worker.robot.placed import (
    FREE,
    FREE_DOFS,
    PlacedRobot,
    contact_reader,
    part_poses,
)

Indices = npt.NDArray[np.intp]
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
        light: position of the light in traces [m]; None is no light.
    """

    def __init__(
        self, placed: PlacedRobot, settings: EvaluationSettings | ArenaSettings
    ) -> None:
        robot, wanted = placed.robot, functions_of(settings).channels
        joints = placed.dofs.stop - placed.dofs.start - FREE_DOFS
        inputs, outputs = robot.brain.count("input"), robot.brain.count("output")
        sizes = {
            "core_attitude": 4,
            "joint_angle": joints,
            "joint_velocity": joints,
            "joint_torque": joints,
            "energy": 1,
            "contact": len(robot.parts),
            "readings": inputs,
            "neighbours": 1,
            "outputs": outputs,
            "commands": outputs,
        }
        self.names = tuple(name for name in RECORDED if name in wanted)
        self._joints, self._inputs, self._outputs = joints, inputs, outputs
        self._placed = placed if "part_poses" in wanted else None
        self._spans: dict[str, slice] = {}
        self.width = 0
        for name in self.names:
            self._spans[name] = slice(self.width, self.width + sizes[name])
            self.width += sizes[name]
        self._constants, self.light = placed.constants(settings), settings.light
        if "part_position" in wanted:
            shapes = shapes_of(robot, placed.space)
            self._constants["part_position"] = place_parts(robot, shapes)[1]

    def row(
        self,
        qpos: Floats,
        qvel: Floats,
        *,
        probe: Floats | None,
        readings: Floats,
        neighbours: int,
        outputs: Floats,
        commands: Floats,
    ) -> Floats:
        """Return a sample as a row.

        Positions are (7 + J,) or more, velocities (6 + J,) or more, readings (1, I')
        with I' >= I, outputs (O',) with O' >= O if they are recorded, commands (O,);
        ``probe`` is ``Probe.numbers``.
        """
        values: dict[str, Floats | int] = {
            "core_attitude": qpos[3:FREE],
            "joint_angle": qpos[FREE : FREE + self._joints],
            "joint_velocity": qvel[FREE_DOFS : FREE_DOFS + self._joints],
            "readings": readings[0, : self._inputs],
            "neighbours": neighbours,
            "outputs": outputs[: self._outputs],
            "commands": commands,
        }
        if probe is not None:
            first = 1 + self._joints
            values["energy"], values["joint_torque"] = probe[:1], probe[1:first]
            values["contact"] = probe[first:]
        row = np.empty(self.width)
        for name, span in self._spans.items():
            row[span] = values[name]
        return row

    def trace(
        self, robot: Robot, interval_s: float, positions: Floats, rows: Iterable[Floats]
    ) -> Trace:
        """Return the trace of some samples."""
        constants = self._constants | {"robot": robot, "light": self.light}
        if not self.names:
            return Trace(interval_s, positions, constants)
        table = np.array(list(rows)).reshape(len(positions), self.width)
        found: dict[str, Any] = {n: table[:, span] for n, span in self._spans.items()}
        if "energy" in found:
            found["energy"] = found["energy"][:, 0] - found["energy"][:1, 0]
        if "contact" in found:
            found["contact"] = found["contact"] != 0.0
        if "neighbours" in found:
            found["neighbours"] = found["neighbours"][:, 0].astype(np.int64)
        if self._placed is not None:
            state = positions, found["core_attitude"], found["joint_angle"]
            found["part_poses"] = part_poses(self._placed, *state)
        return Trace(interval_s, positions, found | constants)


class Probe:
    """Work, torques and contacts of one robot in a model, as of the last step.

    Attributes:
        numbers: (1 + J + P,) work of the motors since birth [J], torque of each joint
            [N m or N], whether each part touches anything but the robot.
    """

    def __init__(self, placed: PlacedRobot, motors: slice) -> None:
        model, data, dofs = placed.model, placed.data, placed.dofs
        self._contacts = contact_reader(model, data)
        self._velocities = data.qvel
        self._timestep_s = float(model.opt.timestep)
        first = dofs.start + FREE_DOFS
        driven = model.jnt_dofadr[model.actuator_trnid[motors, 0]]
        self._dofs: Indices = driven.astype(np.intp)
        self._forces: Floats = data.actuator_force[motors]
        self._before: Floats = data.actuator_velocity[motors]
        self._slopes: Floats = model.actuator_biasprm[motors, 2].copy()
        # No copy: torques may change.
        self._limits: Floats = model.actuator_forcerange[motors, 1]
        prefix = placed.prefix
        self._part_of = {
            geom: int(model.geom(geom).name.removeprefix(prefix).partition("/")[0])
            for geom in range(*placed.geoms)
        }
        self._driven = 1 + self._dofs - first
        self._parts = 1 + dofs.stop - first
        self.numbers: Floats = np.zeros(self._parts + len(placed.robot.parts))

    def add_work(self) -> None:
        """Add the work of the step that was just made."""
        now = self._velocities[self._dofs]
        # The integrator moves joints by the velocity after the step.
        power = np.abs(self._torques(now) * now)
        self.numbers[0] += self._timestep_s * float(power.sum())

    def read(self) -> Floats:
        """Read torques and contacts; return ``numbers``."""
        part_of, parts = self._part_of, self._parts
        self.numbers[self._driven] = self._torques(self._velocities[self._dofs])
        self.numbers[parts:] = 0.0
        for one, other in self._contacts():
            if (one in part_of) != (other in part_of):
                touching = part_of[one if one in part_of else other]
                self.numbers[parts + touching] = 1.0
        return self.numbers

    def _torques(self, now: Floats) -> Floats:
        """Return the torques that acted in the last step.

        The integrator is implicit in velocity: a servo that is not at its limit acts
        with the torque of the velocity after the step.
        """
        torques = self._forces + self._slopes * (now - self._before)
        is_limited = np.abs(self._forces) >= self._limits
        return np.where(is_limited, self._forces, torques)


class EngineView(PlacedRobot):
    """A robot in a model, with its sensors and motors.

    Attributes:
        qpos, qvel, ctrl: its part of the state, live.
        probe: of its work, torques and contacts; None if nothing needs them.
    """

    def __init__(
        self,
        robot: Robot,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        settings: EvaluationSettings | ArenaSettings,
        prefix: str = "",
    ) -> None:
        super().__init__(robot, body_space(settings.space), model, data, prefix)
        width = settings.space.max_inputs
        arena = getattr(settings, "arena", None)
        has_light = is_lit(settings.environment, arena)
        self.sensors = Sensors(self, width=width, has_light=has_light)
        self.servos = Servos(self)
        self.probe = None
        if probed_channels(settings):
            self.probe = Probe(self, self.servos.actuators)
        self.qpos: Floats = data.qpos[self.joints]
        self.qvel: Floats = data.qvel[self.dofs]
        self.ctrl: Floats = data.ctrl[self.servos.actuators]

    def row(
        self, channels: Channels, neighbours: int, outputs: Floats, readings: Floats
    ) -> Floats:
        """Return a sample of the present state as a row; outputs are the brain's."""
        return channels.row(
            self.qpos,
            self.qvel,
            probe=None if self.probe is None else self.probe.read(),
            readings=readings,
            neighbours=neighbours,
            outputs=outputs,
            commands=self.ctrl,
        )

    def copy_from(self, other: "EngineView") -> None:
        """Copy the robot's whole state from its view of another model."""
        self.qpos[:], self.qvel[:] = other.qpos, other.qvel
        self.ctrl[:] = other.ctrl
        self.sensors.readings[:] = other.sensors.readings
        self.sensors.velocities = list(other.sensors.velocities)
        if self.probe is not None and other.probe is not None:
            self.probe.numbers[:] = other.probe.numbers

    def touched_of(self, other: "EngineView", touched: Iterable[int]) -> set[int]:
        """Return which of the robot's geoms are in contact in another model."""
        first, end = other.geoms
        shift = self.geoms[0] - first
        return {geom + shift for geom in touched if first <= geom < end}


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
