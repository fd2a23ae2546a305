"""Motors of one robot: network outputs to commanded joint velocities."""

import mujoco

from schema.parts import BodySpace
from schema.robot.results import Floats
from schema.robot.robot import Robot

LOWEST_OUTPUT = 1e-5
HIGHEST_OUTPUT = 0.99999
"""Outputs are clipped to these before they become target angles."""


class Servos:
    """Velocity servos of one robot in a model, in part order.

    Attributes:
        actuators: indices of its actuators in the model, contiguous.
        motors: of each, the address of its joint's angle in the model, lowest target,
            range of the targets, gain and greatest velocity. Of a motor that controls
            the velocity, targets are velocities, and the gain is 0.
        free: indices in ``motors`` of those that control the velocity.
    """

    def __init__(
        self,
        robot: Robot,
        space: BodySpace,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        *,
        prefix: str = "",
    ) -> None:
        """Find the actuators.

        Args:
            robot: the robot.
            space: its part types.
            model: a compiled model that holds it.
            data: the model's state.
            prefix: of the robot's names in the model.
        """
        self.motors: list[tuple[int, float, float, float, float]] = []
        self.free: list[int] = []
        found: list[int] = []
        for index, part in enumerate(robot.parts):
            motor = space[part.kind].motor
            if motor is None:
                continue
            name = f"{prefix}joint{index}"
            found.append(model.actuator(name).id)
            joint = model.joint(name).id
            low, high = model.jnt_range[joint].tolist()
            address = int(model.jnt_qposadr[joint])
            limits = (low, high - low, motor.gain, motor.max_velocity)
            if motor.control == "velocity":
                fastest = motor.max_velocity
                limits = (-fastest, 2.0 * fastest, 0.0, fastest)
                self.free.append(len(self.motors))
            self.motors.append((address, *limits))
        first = found[0] if found else 0
        self.actuators = slice(first, first + len(found))
        assert found == list(range(first, first + len(found)))
        # Memory views are faster than arrays, number by number.
        self._angles = data.qpos.data
        self._commands = data.ctrl[self.actuators].data

    def drive(self, outputs: Floats) -> None:
        """Command each joint towards its target, until the next tick.

        Writes the state's ``ctrl`` [rad/s], of sliders [m/s].

        Args:
            outputs: (O,) of the network, unclipped; O may exceed the motors.
        """
        angles, commands = self._angles, self._commands
        for index, ((address, low, span, gain, fastest), output) in enumerate(
            zip(self.motors, outputs.tolist(), strict=False)
        ):
            # Bounds by comparison: twice as fast as min and max.
            share = output
            if share < LOWEST_OUTPUT:
                share = LOWEST_OUTPUT
            elif share > HIGHEST_OUTPUT:
                share = HIGHEST_OUTPUT
            command = gain * (low + share * span - angles[address])
            if command < -fastest:
                command = -fastest
            elif command > fastest:
                command = fastest
            commands[index] = command
        for index in self.free:
            share = min(max(float(outputs[index]), LOWEST_OUTPUT), HIGHEST_OUTPUT)
            _, low, span, _, _ = self.motors[index]
            commands[index] = low + share * span
