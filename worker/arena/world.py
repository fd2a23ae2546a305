"""An arena: robots that are born, live together, are evaluated and die.

Everything that happens at a step happens on arrival there, in this order: diverged
robots are removed; controllers tick; settings change; positions are sampled; contacts
are counted; clusters of robots that may touch soon are merged. Then the physics
continues, without interruption, to the next such moment. A state between two advances
is therefore complete, and the way of an arena does not depend on the number of
advances.
"""

import itertools
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Self

from schema.errors import SimulationDiverged, UnexpectedEvent
from schema.experiment.changes import settings_at
from schema.experiment.settings import ArenaSettings
from schema.limits import ADVANCE_BYTES
from schema.robot.ids import BirthId
from schema.wire.arena import (
    Advance,
    Box,
    BrainChange,
    Casualty,
    Changes,
    Insertion,
    Judgement,
)
from schema.wire.arena_state import ArenaState
from schema.wire.codec import decode, encode
from schema.wire.poses import PoseArrays
from worker.arena.batched_control import BatchedControllers, look
from worker.arena.changes import check_changes, diverged, newborn
from worker.arena.records import Contacts, MotorWork, PoseLog, Samples
from worker.arena.snapshot import state_of, take_in
from worker.arena.threads import ThreadTeam
from worker.clusters.population import ArenaPopulation
from worker.clusters.robot import ArenaRobot
from worker.clusters.states import Rollout, Schedule
from worker.robot.placed import silence_engine

_FEW = 5
"""Fewer clusters than this are stepped faster by one thread than by several."""


class World:
    """One arena shard; a pure function of its settings, changes and advances.

    An arena may be simulated in parts: worlds that hold whole clusters each. They are
    equal to the whole if, after each advance, no box swept by a robot of one part
    overlaps that of a robot of another.

    Attributes:
        step: physics steps since the start.
        population: the living robots and their clusters; read only.
        reached: state at the end of the last advance.
        swept: boxes of the robots that lived in the last advance, from the changes
            before it on; points where no check for merges was made.
    """

    def __init__(self, settings: ArenaSettings, threads: int = 1) -> None:
        """Initialise an empty arena.

        Results do not depend on the number of threads, the caller's included.
        """
        silence_engine()
        clock = settings.simulation
        self.step = 0
        self.population = ArenaPopulation(settings)
        self._settings = self._present = settings
        self._schedule = Schedule(settings)
        self._pool = ThreadTeam(threads)
        controls = self.population.model_cache.controls
        self._controllers = BatchedControllers(settings, controls)
        self._casualties: list[Casualty] = []
        self._contacts = Contacts(settings) if settings.arena.record_touches else None
        self._poses = PoseLog(clock.timestep_s)
        self._samples = Samples(settings, self.population)
        self._work = MotorWork(settings)
        self._measures_work = False
        self.swept: dict[BirthId, Box] = {}
        self.reached = self.state()
        self._change()

    def close(self) -> None:
        """Stop the threads; the world cannot be advanced any more."""
        self._pool.close()

    @property
    def births(self) -> tuple[BirthId, ...]:
        """Births of the living robots, ascending."""
        return tuple(robot.birth for robot in self.population.robots)

    def poses(self) -> PoseArrays:
        """Return the present poses."""
        now = PoseLog(self._settings.simulation.timestep_s)
        now.add(self.step, self.population.layout, self.population.layout.read())
        return now.take()

    def apply(self, changes: Changes) -> None:
        """Remove robots, insert robots, replace brains, in this order.

        A robot that the engine cannot build, or fails on at once, or whose brain the
        code of a user does not take, is a casualty of the next advance. A new brain
        starts at rest at the next tick, until which the motors hold their commands;
        body and motion of the robot go on. A window that is restarted has the present
        sample as its first.

        Raises:
            UnexpectedEvent: a robot that does not live here, lives here already, is
                named twice, is born between two ticks of the controllers, or has its
                window restarted between two samples; nothing is changed.
            InvalidRobot: a robot that breaks the rules, or a brain that does not
                fit its body; nothing is changed.
        """
        check_changes(changes, self.population, self.step)
        self.population.patch_lights = changes.lights
        self.population.remove(changes.removals)
        if changes.insertions:
            self._insert(changes.insertions)
        for change in changes.brains:
            if change.birth in self.population:
                self._replace_brain(change)
        if changes.removals or changes.insertions or changes.brains:
            self._controllers.gather(self.population.robots)

    def check_merges(self) -> None:
        """Merge clusters as births do, where robots are born in another part."""
        self.population.kinematics()
        self.population.merge()

    def advance(
        self,
        until: int,
        *,
        work_j: Mapping[BirthId, float] | None = None,
        judges: bool = True,
    ) -> Advance:
        """Advance the arena to a step; judge the robots, or go on without it.

        The work of the motors is added to that of robots so far, 0 if it has none [J];
        None measures none.

        Raises:
            UnexpectedEvent: ``until`` is not later than the present step.
        """
        if until <= self.step:
            raise UnexpectedEvent(
                f"advance: until must be > step = {self.step}, got {until}"
            )
        self._measures_work = work_j is not None
        if work_j is not None:
            self._work.begin(self.population.robots, work_j)
        self.step_to(until)
        return self._report(judges=judges)

    def step_to(self, until: int) -> None:
        """Begin an advance: go to a step before its end, without judging robots."""
        while self.step < until:
            self._advance_interval(self._schedule.moments(self.step, until))

    def snapshot(self) -> bytes:
        """Return the whole state, for ``restore``."""
        return encode(self.state())

    def digest(self) -> bytes:
        """Return the digest of the state."""
        return self.state().digest

    def state(self) -> ArenaState:
        """Return the whole state."""
        return state_of(self._settings, self.step, self.population, self._casualties)

    def costs(self) -> dict[BirthId, float]:
        """Return the share of each robot in the cost of its cluster."""
        return {
            birth: cluster.cost / len(cluster.members)
            for cluster in self.population.clusters
            for birth in cluster.members
        }

    def take_in(self, state: ArenaState) -> None:
        """Add robots of another part of the arena, in whole clusters.

        Raises:
            MalformedMessage: of other settings, or not whole clusters.
            UnexpectedEvent: of another step, or robots that live here already.
        """
        living = [birth for birth, _ in state.robots if birth in self.population]
        if state.step != self.step or living:
            got = f"step {state.step}, {living} live here"
            raise UnexpectedEvent(f"take in: must be of step {self.step}, got {got}")
        take_in(self._settings, state, self.population)
        self._controllers.gather(self.population.robots)

    @classmethod
    def restore(cls, settings: ArenaSettings, data: bytes, threads: int = 1) -> Self:
        """Return the world of a snapshot; it continues equal to the last bit.

        Raises:
            MalformedMessage: not a snapshot, or of other settings.
        """
        state = decode(ArenaState, data, ADVANCE_BYTES)
        world = cls(settings, threads)
        world.step, world._casualties = state.step, list(state.casualties)
        world._change()
        world.take_in(state)
        return world

    # --- time -------------------------------------------------------------------

    def _advance_interval(self, moments: Sequence[int]) -> None:
        """Step all clusters through an interval, then handle its moments."""
        plan = [b - a for a, b in itertools.pairwise((self.step, *moments))]
        self._run(plan)
        is_merge = [self._schedule.is_merge(step) for step in moments]
        rollout = self.population.begin(plan, is_merge)
        for moment, step in enumerate(moments):
            self.step, rollout.moment = step, moment
            self._arrive(rollout)
            self.population.catch_up()
        self.population.end()
        if self._schedule.is_split(self.step):
            self.population.split(rollout.state)

    def _run(self, plan: Sequence[int]) -> None:
        clusters = self.population.by_cost
        if len(clusters) < _FEW or self._pool.threads == 1:
            for cluster in clusters:
                cluster.run(plan)
            return
        self._pool.run([partial(cluster.run, plan) for cluster in clusters])

    def _arrive(self, rollout: Rollout) -> None:
        """Do everything that is due at the present moment."""
        step, on = self.step, self._schedule
        is_tick, is_sample = on.is_tick(step), on.is_sample(step)
        is_merge = on.is_merge(step)
        if not (is_tick or is_sample or is_merge):
            return
        reads_warnings = on.is_split(step)
        self._remove(
            diverged(self.population, rollout, step, reads_warnings=reads_warnings)
        )
        if is_merge and self._measures_work and self.population.robots:
            self._work.add(self.population.layout, rollout.state)
        if is_tick:
            self._tick()
            if self._settings.changes:
                self._change()
        if is_sample:
            self._samples.add(step, rollout.state)
            self._poses.add(step, self.population.layout, rollout.state)
        if is_merge:
            if self._contacts is not None:
                self._contacts.count(self.population.clusters, rollout.moment)
            self.population.merge()

    def _change(self) -> None:
        """Give the world the settings of the last tick."""
        clock = self._settings.simulation
        tick = self.step - self.step % clock.brain_steps
        # Rounded: 60600 steps of 0.005 s are 303 s.
        settings = settings_at(self._settings, round(tick * clock.timestep_s, 9))
        if settings is not self._present:
            self._present = settings
            self.population.change(settings)
            self._controllers.change(settings, self.population.robots)
            if self._measures_work:
                self._work.read_motors(self.population.robots)

    def _tick(self) -> None:
        """Read sensors, update brains and command motors.

        A tick is the last moment of its interval, so the engine's states are those of
        the moment.
        """
        tick_s = self._settings.simulation.tick_s
        cluster_of = self.population.cluster_of
        for robot in self.population.robots:
            robot.view.sensors.read(tick_s, cluster_of[robot.birth].touched)
        self._remove(look(self.population, self.population.robots, self.step))
        robots = self.population.robots
        outputs = self._controllers.tick(self.step, robots)
        for robot, row in zip(robots, outputs, strict=True):
            robot.view.servos.drive(row)
        broken = self._controllers.broken.items()
        self._remove_broken([(robots[row], reason) for row, reason in broken])

    # --- births and deaths ------------------------------------------------------

    def _insert(self, insertions: Sequence[Insertion]) -> None:
        robots: list[ArenaRobot] = []
        for insertion in insertions:
            robot = newborn(insertion, self.population, self.step)
            if isinstance(robot, Casualty):
                self._casualties.append(robot)
            else:
                robots.append(robot)
        self.population.add(robots)
        failed = look(self.population, robots, self.step)
        self._casualties += failed
        self.population.remove([casualty.birth for casualty in failed])
        robots = [robot for robot in robots if robot.birth in self.population]
        first_tick = partial(self._controllers.first_tick, self.step)
        begun = [(robot, first_tick(robot)) for robot in robots]
        self._remove_broken([each for each in begun if each[1]])
        for robot in robots:
            if robot.birth in self.population:
                self._samples.first(self.step, robot)
        self.check_merges()

    def _replace_brain(self, change: BrainChange) -> None:
        robot = self.population.find(change.birth)
        start = self._schedule.next_tick(self.step)
        controls = self.population.model_cache.controls
        try:
            robot.set_brain(change.brain, controls, start)
        except SimulationDiverged as error:
            self._remove_broken([(robot, str(error))])
            return
        if change.restarts_window:
            robot.window.restart()

    def _remove(self, casualties: Sequence[Casualty]) -> None:
        self._casualties += casualties
        if casualties:
            self.population.remove([casualty.birth for casualty in casualties])
            self._controllers.gather(self.population.robots)

    def _remove_broken(self, broken: Sequence[tuple[ArenaRobot, str]]) -> None:
        """Remove robots whose brains broke, each with the reason."""
        self._remove([Casualty(r.birth, self.step, why, r.place) for r, why in broken])

    def _report(self, *, judges: bool) -> Advance:
        robots = self.population.robots if judges else ()
        found = [robot.judgement(self.step, self._present) for robot in robots]
        self._remove([each for each in found if isinstance(each, Casualty)])
        casualties = sorted(self._casualties, key=lambda lost: (lost.step, lost.birth))
        places = {robot.birth: robot.place for robot in self.population.robots}
        places |= {lost.birth: lost.place for lost in casualties}
        self.swept = {birth: (x, y, x, y) for birth, (x, y, _) in places.items()}
        self.swept |= self.population.proximity.take_swept()
        self._casualties = []
        self.reached = self.state()
        return Advance(
            step=self.step,
            digest=self.reached.digest,
            judgements=tuple(each for each in found if isinstance(each, Judgement)),
            casualties=tuple(casualties),
            touches=() if self._contacts is None else self._contacts.take(),
            poses=self._poses.take().message(),
            work_j=tuple(robot.work_j for robot in self.population.robots)
            if self._measures_work
            else (),
        )
