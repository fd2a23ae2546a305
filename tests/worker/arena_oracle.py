"""One model of all robots of an arena, to detect contacts that clusters miss."""

import mujoco
import numpy as np

from schema.experiment.document import body_space
from schema.mjcf.model import robot_spec, shared_model
from schema.robot.ids import BirthId
from schema.robot.trace import Floats
from worker.arena.world import World
from worker.clusters.states import Rollout, StateColumns


class Oracle:
    """Detects every contact between robots at every physics step of a world.

    Attributes:
        pair_steps: pairs of robots in contact, summed over steps.
        missed: those of them whose robots were in different clusters.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.pair_steps = 0
        self.missed: list[tuple[int, BirthId, BirthId]] = []
        self._births: tuple[BirthId, ...] = ()
        self._model: mujoco.MjModel | None = None
        schedule = world._schedule
        self._moments, self._arrive = schedule.moments, world._arrive
        schedule.moments = self._every_step  # type: ignore[method-assign]
        world.population._columns = StateColumns(schedule.tick_steps)
        world._arrive = self._observed_arrive  # type: ignore[method-assign]

    def _every_step(self, step: int, until: int) -> tuple[int, ...]:
        return tuple(range(step + 1, self._moments(step, until)[-1] + 1))

    def _observed_arrive(self, rollout: Rollout) -> None:
        self._arrive(rollout)
        self._check(self.world.step, rollout.state)

    def _check(self, step: int, state: Floats) -> None:
        population = self.world.population
        if self.world.births != self._births:
            self._build()
        if self._model is None or self._data is None:
            return
        data, layout = self._data, population.layout
        places = zip(layout.starts, layout.robot_rows.sizes, strict=True)
        data.qpos[:] = np.concatenate(
            [state[start : start + size] for start, size in places]
        )
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        mujoco.mj_collision(self._model, data)
        owners = self._owners[data.contact.geom]
        owners = np.sort(owners[(owners >= 0).all(axis=1)], axis=1)
        for a, b in sorted({(a, b) for a, b in owners.tolist() if a != b}):
            self.pair_steps += 1
            first, second = self._births[a], self._births[b]
            if population.cluster_of[first] is not population.cluster_of[second]:
                self.missed.append((step, first, second))

    def _build(self) -> None:
        population = self.world.population
        self._births = self.world.births
        self._model = self._data = None
        if len(self._births) < 2:
            return
        settings = population.model_cache.settings
        types = body_space(settings.space)
        prefixes = [f"{number}/" for number in range(len(self._births))]
        specs = [
            robot_spec(one.body.robot, types, settings.simulation).spec
            for one in population.robots
        ]
        self._model = shared_model(
            list(zip(prefixes, specs, strict=True)),
            settings.simulation,
            settings.environment,
        )
        self._data = mujoco.MjData(self._model)
        root_of = self._model.body_rootid[self._model.geom_bodyid]
        roots = [
            mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, f"{prefix}root")
            for prefix in prefixes
        ]
        owner = {root: index for index, root in enumerate(roots)}
        self._owners = np.array([owner.get(int(root), -1) for root in root_of])
