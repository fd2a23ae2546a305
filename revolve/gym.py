"""Environments of Gymnasium: train a controller on the body of a robot.

Importing this module registers ``revolve/TASK-v0`` for each of ``TASKS``.
docs/simulation.md has observations, actions and rewards.
"""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from revolve.experiment import Experiment, document_of
from revolve.robot import DEFAULT, Robot
from revolve.simulation import Simulation
from schema.agent.extras import extra
from schema.errors import RevolveError
from schema.experiment.document import island_experiment
from schema.experiment.settings import FITNESS
from schema.limits import MOST_TRIAL
from schema.robot.trace import Floats

with extra("rv.gym needs", "gym"):
    import gymnasium
    from gymnasium.spaces import Box

__all__ = ["TASKS", "RobotEnv", "make"]
_NAMES = (*FITNESS, "stairs", "rough-ground")
TASKS = {name: name for name in _NAMES} | {"locomotion": DEFAULT}
"""Experiment of each task, by the name of the task."""
HIGHEST = 1000.0
"""Observations are clipped to this and its negative."""
Action = npt.NDArray[np.float32]
Task = Experiment | str | Path


class RobotEnv(gymnasium.Env[Floats, Action]):
    """Environment of Gymnasium: one robot, one task, an episode per evaluation.

    The rewards of an episode sum to its fitness: each is the growth of (share of the
    window that is over) x (fitness of the window so far). If the simulation fails, they
    sum to 0.

    Attributes:
        simulation: of the present episode.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 8}  # noqa: RUF012 - typed by Gymnasium

    def __init__(
        self, robot: Robot, task: Task, *, render_mode: str | None = None
    ) -> None:
        """Build the spaces; see ``make``."""
        experiment = _experiment(robot, task)
        self.simulation = Simulation(robot, experiment)
        clock = document_of(experiment).simulation
        self._window_s = clock.window_steps * clock.timestep_s
        inputs, motors = len(self.simulation.inputs), len(self.simulation.motors)
        if not motors:
            raise RevolveError("robot: must have a motor to be trained, got none")
        self.observation_space = Box(-HIGHEST, HIGHEST, (inputs,), np.float64)
        self.action_space = Box(-1.0, 1.0, (motors,), np.float32)
        self.render_mode = render_mode

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Start an episode; ``options`` are arguments of ``Simulation.reset``."""
        super().reset(seed=seed)
        trial = int(self.np_random.integers(MOST_TRIAL + 1))
        self.simulation.reset(**{"trial": trial, **(options or {})})
        self._credit = 0.0
        return self._observed(), {}

    def step(self, action: Action) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Do one brain tick.

        Returns:
            Observation (I,); reward; whether the simulation failed; whether the window
            is over; at the end ``fitness``, and ``failure`` if it failed.
        """
        simulation, info = self.simulation, dict[str, Any]()
        simulation.step(action)
        credit, failure = self._earned(), simulation.failure
        reward, self._credit = credit - self._credit, credit
        if simulation.done:
            info = {"fitness": credit, **({"failure": failure} if failure else {})}
        is_over = simulation.done and not failure
        return self._observed(), reward, bool(failure), is_over, info

    def _observed(self) -> Floats:
        return np.clip(self.simulation.observe(), -HIGHEST, HIGHEST)

    def _earned(self) -> float:
        """Return the sum of the rewards so far."""
        simulation, fitness = self.simulation, self.simulation.fitness
        if fitness is None or simulation.done:
            return fitness or 0.0
        return fitness * simulation.trace.duration_s / self._window_s

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Return a picture of 640 x 480 pixels; None without a render mode."""
        return self.simulation.render() if self.render_mode else None

    def close(self) -> None:
        """Free the renderer."""
        self.simulation.close()


def _experiment(robot: Robot, task: Task) -> Experiment:
    """Return the experiment of a robot's episodes; each is one draw of ``[robust]``.

    A task gives fitness, environment and simulation; part types and brain are those of
    the robot's own experiment, if it has one.
    """
    name = TASKS.get(task) if isinstance(task, str) else None
    document = island_experiment(document_of(name or task), 0)
    if name and robot.experiment is not None:
        own = island_experiment(document_of(robot.experiment), 0)
        document = replace(document, space=own.space, brain=own.brain)
    if document.robust is not None:
        document = replace(document, robust=replace(document.robust, draws=1))
    return Experiment(document)


def make(
    robot: Robot,
    task: Task,
    **options: Any,  # noqa: ANN401 - passed on
) -> "gymnasium.Env[Floats, Action]":
    """Return an environment of Gymnasium for a robot and a task.

    ``gymnasium.make("revolve/locomotion-v0", robot=robot)`` is the same.

    Args:
        robot: whose body is trained; its brain has no part in it.
        task: a name of ``TASKS``, or an experiment.
        options: of ``gymnasium.make``, such as ``render_mode="rgb_array"``.

    Raises:
        RevolveError: the robot has no motor; as of ``Simulation``.
    """
    name = task if task in TASKS else "experiment"
    return gymnasium.make(f"revolve/{name}-v0", robot=robot, task=task, **options)


for _name in (*TASKS, "experiment"):
    _given = {"task": _name} if _name in TASKS else {}
    gymnasium.register(f"revolve/{_name}-v0", "revolve.gym:RobotEnv", kwargs=_given)
