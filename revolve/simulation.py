"""Simulations that the caller steps, in the process of the caller."""

from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from analysis.render.stage import choose_engine
from revolve.arguments import finite_numbers, in_order, picture_size, whole_number
from revolve.evaluation import outside_of_runs, settings_for
from revolve.experiment import Experiment
from revolve.robot import Robot, checked
from schema.agent.extras import extra
from schema.agent.supervisor import cores
from schema.errors import FAILURES, RevolveError
from schema.experiment.brains import types_of
from schema.experiment.document import body_space
from schema.robot.robot import Robot as PlainRobot
from schema.robot.trace import Floats, Trace
from worker.arena.threads import ThreadTeam

Action = npt.ArrayLike | None


class Simulation(AbstractContextManager["Simulation"]):
    """A robot alone in its environment, one brain tick at a time, in this process.

    With the robot's own brain it is ``evaluate``, to the last bit: the same loop. With
    ``[robust]`` its simulations follow each other.

    Args:
        robot, experiment, trial, record: as for ``evaluate``.

    Attributes:
        inputs: names of the I observed numbers, in their order.
        motors: names of the M motors, in the order of an action.
        failure: why the simulation has failed, such as diverged physics; or empty.

    Raises:
        SimulationDiverged: the robot cannot be built; others are those of ``evaluate``.
    """

    def __init__(
        self,
        robot: Robot | PlainRobot,
        experiment: Experiment | str | Path | None = None,
        *,
        trial: int = 0,
        record: Sequence[str] = (),
    ) -> None:
        """Build the model and start."""
        choose_engine()
        from worker.filters.channels import inputs_of, motors_of  # noqa: PLC0415
        from worker.kinds import checked as with_plugins  # noqa: PLC0415

        settings = settings_for(robot, experiment, record)
        self._robot = checked(robot, types_of(settings))
        self._settings = with_plugins(settings)
        space = body_space(settings.space)
        self.inputs = tuple(name for *_, name in inputs_of(self._robot, space))
        self.motors = tuple(name for *_, name in motors_of(self._robot, space))
        self._renderer: Any = None
        self._size = (0, 0)
        self.reset(trial=trial)

    def reset(
        self,
        *,
        place: npt.ArrayLike = (0.0, 0.0),
        attitude_deg: npt.ArrayLike | None = None,
        trial: int | None = None,
    ) -> None:
        """Start again; raises as the class.

        Args:
            place: of the core in the ground plane, world frame, (2,) [m].
            attitude_deg: in the place of ``simulation.start_deg``, (3,) [degrees].
            trial: number of the evaluation; None: as before.
        """
        from worker.robot.evaluation import EvaluationLoop  # noqa: PLC0415

        x, y = finite_numbers("place", place, 2, ", x and y [m]").tolist()
        settings = self._settings
        if attitude_deg is not None:
            unit = ", roll, pitch and yaw [degrees]"
            start = finite_numbers("attitude_deg", attitude_deg, 3, unit).tolist()
            clock = replace(settings.simulation, start_deg=tuple(start))
            settings = replace(settings, simulation=clock)
        if trial is not None:
            self._identity = outside_of_runs(trial)
        self.failure = ""
        self._loop = EvaluationLoop(self._robot, settings, self._identity, place=(x, y))

    def observe(self) -> Floats:
        """Return what the brain receives at this tick, (I,), named by ``inputs``.

        Accelerations [m/s2] and rotations [rad/s] of an imu have no bounds, touch is 0
        or 1, light 0 to 1, before noise and calibration.
        """
        return np.array(self._loop.loop.observe()[0])

    def step(self, action: Action = None) -> None:
        """Move the motors, and simulate until the next brain tick or the end.

        Args:
            action: (M,) targets of the motors: -1 is the lower end of a joint's range,
                0 its middle and 1 its upper end, or full speed backwards, rest and
                forwards; values beyond are clipped. None: the robot's own brain, which
                does not tick otherwise.

        Raises:
            RevolveError: the simulation is over, or an action that is none.
        """
        if self.done:
            raise RevolveError("step: the simulation is over; reset starts it again")
        if action is not None:
            action = finite_numbers(
                "action", action, len(self.motors), ", one per motor"
            )
        try:
            self._loop.step(action)
            self._loop.loop.observe()  # finds physics that diverged
        except FAILURES as error:
            self.failure = str(error)

    @property
    def done(self) -> bool:
        """Whether the evaluation is over, or has failed."""
        return self._loop.done or bool(self.failure)

    @property
    def fitness(self) -> float | None:
        """Fitness, or that of the window so far; None before two samples, or failed."""
        return None if self.failure else self._loop.fitness()

    @property
    def trace(self) -> Trace:
        """Recording so far of the present simulation."""
        return self._loop.loop.trace()

    @property
    def model(self) -> Any:  # noqa: ANN401 - MuJoCo has no types
        """``MjModel`` of the present simulation; ``reset`` makes a new one."""
        return self._loop.loop.model

    @property
    def data(self) -> Any:  # noqa: ANN401 - as above
        """``MjData`` of the present simulation: what is changed there takes effect."""
        return self._loop.loop.data

    def render(self, width: int = 640, height: int = 480) -> npt.NDArray[np.uint8]:
        """Return a picture of the present state, (H, W, 3) red, green, blue.

        Size and errors are those of ``Robot.picture``.
        """
        size = picture_size(width, height)
        if self._renderer is None or self._size != size:
            with extra("pictures need", "pictures"):
                from analysis.render.picture import RobotRenderer  # noqa: PLC0415
            self.close()
            self._renderer = RobotRenderer(self._robot, self._settings, size=size)
            self._size = size
        return np.asarray(self._renderer.picture(self.data.qpos), np.uint8)

    def close(self) -> None:
        """Free the renderer; ``render`` makes another one."""
        if self._renderer is not None:
            self._renderer.__exit__(None, None, None)
            self._renderer = None

    def __exit__(self, *_: object) -> None:
        self.close()


class Simulations(AbstractContextManager["Simulations"]):
    """Simulations of several robots that are stepped together, by threads.

    Each equals a ``Simulation`` of its own, to the last bit.

    Args:
        robots: to simulate; their order must be defined.
        experiment, trial: of all robots; they and errors are those of ``Simulation``.
        threads: that share the robots; None: one per core.

    Attributes:
        simulations: one for each robot.
    """

    def __init__(
        self,
        robots: Iterable[Robot | PlainRobot],
        experiment: Experiment | str | Path | None = None,
        *,
        trial: int = 0,
        threads: int | None = None,
    ) -> None:
        """Start all simulations."""
        count = cores() if threads is None else whole_number("threads", threads, 1)
        self.simulations = tuple(
            Simulation(robot, experiment, trial=trial)
            for robot in in_order("robots", robots)
        )
        self._team = ThreadTeam(count)

    def reset(self, *, trial: int | None = None) -> None:
        """Start all simulations again; raises as ``Simulation.reset``."""
        for simulation in self.simulations:
            simulation.reset(trial=trial)

    def step(self, actions: Sequence[Action] | None = None) -> None:
        """Step all simulations that are not over.

        Args:
            actions: one for each robot, as for ``Simulation.step``; None: own brains.

        Raises:
            RevolveError: another number of actions, or an action that is none.
        """
        count = len(self.simulations)
        given = [None] * count if actions is None else actions
        if len(given) != count:
            raise RevolveError(f"actions: must be {count}, got {len(given)}")
        pairs = zip(self.simulations, given, strict=True)
        self._team.run(
            [partial(each.step, act) for each, act in pairs if not each.done]
        )

    def observe(self) -> list[Floats]:
        """Return the observation of each robot."""
        return [each.observe() for each in self.simulations]

    @property
    def done(self) -> npt.NDArray[np.bool_]:
        """Whether each simulation is over or has failed, (N,)."""
        return np.array([each.done for each in self.simulations], np.bool_)

    @property
    def fitness(self) -> list[float | None]:
        """Fitness of each robot, as of ``Simulation.fitness``."""
        return [each.fitness for each in self.simulations]

    def close(self) -> None:
        """Free renderers and threads."""
        for simulation in self.simulations:
            simulation.close()
        self._team.close()

    def __exit__(self, *_: object) -> None:
        self.close()
