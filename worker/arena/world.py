"""An arena: robots that come, live together, are judged all the time, and go.

All that happens at a step happens on arriving there, in this order: the diverged
fall; brains tick; positions are sampled; touches are counted; those who may touch
soon join. Then physics goes on, with nothing but steps, to the next such moment.
So a state between two advances is whole, and how an arena gets somewhere does not
depend on how many advances it took.
"""

import hashlib
import itertools
from collections.abc import Callable, Sequence
from functools import partial
from typing import Self

from schema.errors import UnexpectedEvent
from schema.experiment.settings import ArenaSettings
from schema.robot.ids import BirthId
from schema.robot.results import Floats
from schema.wire.arena import Advance, Casualty, Changes, Insertion
from worker.arena import light, state
from worker.arena.batched_sensors import BatchedIO
from worker.arena.births import check_changes, equip, newborn
from worker.arena.brains import BatchedControllers
from worker.arena.contacts import Contacts
from worker.arena.divergence import diverged
from worker.arena.fitness_window import judge_all
from worker.arena.poses import Poses
from worker.arena.schedule import Schedule
from worker.arena.threads import Pool
from worker.clusters.population import ArenaPopulation
from worker.clusters.robot import ArenaRobot
from worker.clusters.rollout import Rollout
from worker.robot.evaluation import silence_engine
from worker.robot.noise import Source

_FEW = 5
"""Clusters that one thread steps faster than several."""


class World:
    """One arena shard; a pure function of its settings, changes and advances.

    Attributes:
        step: physics steps since it began.
        population: the living and their clusters, to look at.
    """

    def __init__(self, settings: ArenaSettings, threads: int = 1) -> None:
        """Begin with nobody.

        Args:
            settings: the arena's.
            threads: that step clusters, the caller's included; what happens does
                not depend on their number.
        """
        silence_engine()
        self._settings = settings
        self._clock = settings.simulation
        self._schedule = Schedule(settings)
        self._pool = Pool(threads)
        self.reset()

    def reset(self) -> None:
        """Begin anew, with nobody."""
        self.step = 0
        self.population = ArenaPopulation(self._settings)
        width = self.population.model_cache.width
        self._controllers = BatchedControllers(
            Source(self._clock, width, self._settings.origin)
        )
        gravity = self._settings.environment.gravity_vector(self._clock.gravity)
        self._io = BatchedIO(width, self._clock, gravity)
        self._casualties: list[Casualty] = []
        self._touches = Contacts(self._settings)
        self._poses = Poses(self._clock.timestep_s)

    def close(self) -> None:
        """Let the threads end; the world cannot be advanced any more."""
        self._pool.close()

    @property
    def births(self) -> tuple[BirthId, ...]:
        """The names of the living, ascending."""
        return tuple(one.birth for one in self.population.everybody)

    def poses(self) -> bytes:
        """Return where everybody is now: Arrow IPC of ``columns.POSES``."""
        now = Poses(self._clock.timestep_s)
        now.add(self.step, self.population.layout, self.population.layout.read())
        return now.columns()

    def apply(self, changes: Changes) -> None:
        """Take robots out, put robots in, replace brains, in this order.

        A robot that the engine cannot build, or gives up on at once, is a casualty of
        the next advance.

        Args:
            changes: what is done before the next advance.

        Raises:
            UnexpectedEvent: somebody is not there, or there already, named twice,
                or born between two ticks of the brains; nothing is changed.
            InvalidRobot: a robot that breaks the rules, or a brain that does not
                fit its body; nothing is changed.
        """
        check_changes(changes, self.population, self.step)
        self.population.remove(changes.removals)
        if changes.insertions:
            self._insert(changes.insertions)
        for change in changes.brains:
            one = self.population.find(change.birth)
            since = self._schedule.next_tick(self.step)
            equip(one, change.brain, self.population.model_cache.width, since)
        if changes.removals or changes.insertions or changes.brains:
            self._controllers.gather(self.population.everybody)

    def advance(
        self, until: int, watch: Callable[[bytes], None] | None = None
    ) -> Advance:
        """Let time pass.

        Args:
            until: step to reach, later than now.
            watch: is shown each sample of poses as it happens, as ``poses`` does.

        Raises:
            UnexpectedEvent: ``until`` is not later than now.
        """
        if until <= self.step:
            raise UnexpectedEvent(
                f"advance: until must be > step = {self.step}, got {until}"
            )
        while self.step < until:
            self._go(self._schedule.moments(self.step, until), watch)
        return self._report()

    def snapshot(self) -> bytes:
        """Return the whole state; ``restore`` goes on from it bit for bit."""
        return state.write(
            self._settings, self.step, self.population, tuple(self._casualties)
        )

    def digest(self) -> bytes:
        """Return the SHA-256 of the state."""
        return hashlib.sha256(self.snapshot()).digest()

    @classmethod
    def restore(cls, settings: ArenaSettings, data: bytes, threads: int = 1) -> Self:
        """Return the world of a snapshot.

        Args:
            settings: those that it was taken with.
            data: the snapshot.
            threads: that step clusters, the caller's included.

        Raises:
            MalformedMessage: not a snapshot, or of other settings.
        """
        world = cls(settings, threads)
        world.step, casualties = state.read(settings, data, world.population)
        world._casualties = list(casualties)
        world._controllers.gather(world.population.everybody)
        return world

    # --- time -------------------------------------------------------------------

    def _go(
        self, moments: Sequence[int], watch: Callable[[bytes], None] | None
    ) -> None:
        """Let all clusters go through a stretch of time, then look at its moments."""
        plan = [b - a for a, b in itertools.pairwise((self.step, *moments))]
        self._run(plan)
        looks = [self._schedule.is_look(step) for step in moments]
        rollout = self.population.begin(plan, looks)
        for moment, step in enumerate(moments):
            self.step, rollout.moment = step, moment
            self._arrive(rollout, watch)
            self.population.catch_up()
        self.population.end()
        if self._schedule.is_parting(self.step):
            self.population.part(rollout.state)

    def _run(self, plan: Sequence[int]) -> None:
        clusters = self.population.by_cost
        if len(clusters) < _FEW or self._pool.threads == 1:
            for cluster in clusters:
                cluster.run(plan)
            return
        self._pool.run([partial(cluster.run, plan) for cluster in clusters])

    def _arrive(self, rollout: Rollout, watch: Callable[[bytes], None] | None) -> None:
        step, on = self.step, self._schedule
        is_tick, is_sample, is_look = (
            on.is_tick(step),
            on.is_sample(step),
            on.is_look(step),
        )
        if not (is_tick or is_sample or is_look):
            return
        self._drop_diverged(rollout)
        if is_tick:
            self._tick(rollout.state)
        if is_sample:
            self._sample(rollout.state, watch)
        if is_look:
            self._touches.count(self.population.clusters, rollout.moment)
            self.population.look()

    def _tick(self, state: Floats) -> None:
        batched_io = self._io
        batched_io.settle(self.population.layout)
        batched_io.feel(state)
        light.shine(self.population, self.population.everybody)
        batched_io.drive(state, self._controllers.tick(self.step, batched_io.readings))

    def _sample(self, state: Floats, watch: Callable[[bytes], None] | None) -> None:
        layout = self.population.layout
        places = state[layout.roots[:, :3]].tolist()
        for one, (x, y, z) in zip(self.population.everybody, places, strict=True):
            one.place = (x, y, z)
            one.window.add(self.step, one.place)
        self._poses.add(self.step, layout, state)
        if watch is not None:
            now = Poses(self._clock.timestep_s)
            now.add(self.step, layout, state)
            watch(now.columns())

    # --- births and deaths ------------------------------------------------------

    def _insert(self, insertions: Sequence[Insertion]) -> None:
        newcomers: list[ArenaRobot] = []
        for insertion in insertions:
            one = newborn(insertion, self.population, self.step)
            if isinstance(one, Casualty):
                self._casualties.append(one)
            else:
                newcomers.append(one)
        self.population.add(newcomers)
        light.shine(self.population, newcomers)
        for one in newcomers:
            self._controllers.first_tick(self.step, one)
        self.population.kinematics()
        self.population.look()

    def _drop_diverged(self, rollout: Rollout) -> None:
        """Let the diverged go."""
        is_parting = self._schedule.is_parting(self.step)
        fallen = diverged(self.population, rollout, self.step, looks_closely=is_parting)
        self._casualties += fallen
        if fallen:
            self._dismiss([casualty.birth for casualty in fallen])

    def _dismiss(self, births: Sequence[BirthId]) -> None:
        self.population.remove(births)
        self._controllers.gather(self.population.everybody)

    def _report(self) -> Advance:
        judgements, undefined = judge_all(
            self.population.everybody, self.step, self._settings
        )
        self._casualties += undefined
        if undefined:
            self._dismiss([casualty.birth for casualty in undefined])
        casualties, self._casualties = tuple(self._casualties), []
        poses, self._poses = self._poses, Poses(self._clock.timestep_s)
        return Advance(
            step=self.step,
            digest=self.digest(),
            judgements=tuple(judgements),
            casualties=casualties,
            touches=self._touches.hand_over(),
            poses=poses.columns(),
        )
