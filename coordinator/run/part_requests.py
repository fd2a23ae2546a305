"""Requests to the workers of an arena in parts, and checks of what they answer."""

from collections.abc import Mapping, Sequence
from functools import partial

from msgspec import structs

from coordinator.dispatch.events import Assign, Read
from coordinator.parts.arena_parts import AGAIN, EXCHANGE_S, ArenaParts
from coordinator.run.advance_checks import ExpectedAdvance
from coordinator.run.run_context import RunContext
from coordinator.run.shard_answers import PartReached, read_part
from schema.parts import Vector
from schema.robot.ids import BirthId
from schema.robot.results import Provenance
from schema.wire.arena import Advance, AdvanceShard
from schema.wire.arena_state import ArenaState


class PartRequests:
    """The parts of one arena, each a shard of its own in the fleet.

    Attributes:
        parts: the state of the arena.
        wall_s: time that the workers of all parts took for a simulated ``EXCHANGE_S``
            in the last exchange [s].
    """

    def __init__(
        self, context: RunContext, island: int, state: ArenaState, wall_s: float
    ) -> None:
        """Begin with a state that the arena's worker holds."""
        self._context = context
        self._experiment = context.experiments[island]
        arena, clock = self._experiment.arena, self._experiment.simulation
        assert arena is not None
        checks_s = arena.proximity_steps * clock.timestep_s
        steps = max(1, round(EXCHANGE_S / clock.timestep_s))
        self.parts = ArenaParts(state, checks_s, steps)
        self.wall_s = wall_s
        self._waited_s, self._walls_s = 0.0, list[float]()
        self._provenance = Provenance()

    def begin(
        self, requested: AdvanceShard, places: Mapping[BirthId, Vector], count: int
    ) -> None:
        """Request an advance of the arena, in a number of parts."""
        self._waited_s, self._walls_s = 0.0, []
        self.parts.begin(requested, places, count)

    def simulated_s(self) -> float:
        """Return the duration of the present exchange [s]."""
        steps = self.parts.until - self.parts.state.step
        return steps * self._experiment.simulation.timestep_s

    def encode(self, part: int, command: Assign) -> tuple[bytes, Read]:
        """Return the request for a worker, and what reads the answer."""
        is_whole = command.is_whole or part == AGAIN
        work = self.parts.request(part, is_whole=is_whole)
        number = command.job.number
        assert work.part is not None
        read = partial(
            read_part,
            job=(self._context.client.epoch, number),
            is_whole=is_whole,
            expected=ExpectedAdvance(
                work.from_step,
                work.until,
                self.parts.robots(part),
                self._experiment,
                wants_snapshot=False,
                wants_tracks=work.wants_tracks,
                judges=work.part.judges,
            ),
            provenance=Provenance(command.agent, command.platform),
        )
        return self._context.arena_request(number, work), read

    def take(
        self, part: int, reached: PartReached, count: int
    ) -> Advance | Sequence[int]:
        """Take the result of a part.

        Returns:
            The advance of the whole arena, once its last exchange has ended; until then
            parts that are to be requested now, which may be none. There are ``count``
            parts in the next exchange.
        """
        self._walls_s.append(reached.provenance.wall_s)
        if part in (0, AGAIN):
            self._provenance = reached.provenance
        self.parts.take(part, reached.result)
        if self.parts.missing:
            return ()
        if self.parts.overlap():
            return (AGAIN,)
        self.wall_s = sum(self._walls_s) * EXCHANGE_S / self.simulated_s()
        self._waited_s += max(self._walls_s)
        self._walls_s = []
        return self.parts.end(count) or self.parts.missing

    @property
    def provenance(self) -> Provenance:
        """Of the last advance: the worker of part 0, and the time of the slowest."""
        return structs.replace(self._provenance, wall_s=self._waited_s)
