"""A robot in a model: its slices of the engine's state, its sensors and motors."""

from collections.abc import Iterable

import mujoco

from schema.experiment.document import body_space, is_lit
from schema.experiment.settings import ArenaSettings, EvaluationSettings
from schema.robot.robot import Robot
from schema.robot.trace import Floats
from worker.robot.devices import Sensors, Servos
from worker.robot.placed import PlacedRobot
from worker.robot.recording import Channels, Probe, probed_channels


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
        self.probe = Probe(self) if probed_channels(settings) else None
        self.qpos: Floats = data.qpos[self.joints]
        self.qvel: Floats = data.qvel[self.dofs]
        self.ctrl: Floats = data.ctrl[self.servos.actuators]

    def row(self, channels: Channels, neighbours: int, outputs: Floats) -> Floats:
        """Return a sample of the present state as a row; outputs are the brain's."""
        return channels.row(
            self.qpos,
            self.qvel,
            probe=None if self.probe is None else self.probe.read(),
            readings=self.sensors.readings,
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
