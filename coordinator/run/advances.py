"""The advances of a run's arenas: asked of who holds the shard, and remembered.

What a shard was told since its newest snapshot is kept, so that another worker can
rebuild its state. Nothing here decides what happens in an arena.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Protocol

import pyarrow as pa
import pyarrow.compute

from coordinator.dispatch.events import (
    AssignShard,
    Returned,
    ShardDone,
    ShardFailed,
    ShardReturned,
)
from coordinator.dispatch.fleet import Fleet
from coordinator.islands.events import Advanced, AdvanceShard, Record
from schema.errors import JobRefused, MalformedMessage, UnexpectedEvent
from schema.experiment.plugin_source import plugins_of
from schema.parts import Vector
from schema.robot.ids import BirthId
from schema.robot.results import Provenance
from schema.tables.columns import read_columns
from schema.wire.arena import Advance, Casualty
from schema.wire.arena_codec import (
    AdvanceAnswer,
    AdvanceRequest,
    PastAdvance,
    Rebuild,
    decode_advance_answer,
    encode_advance_request,
)


class SnapshotStore(Protocol):
    """Where snapshots of shards are kept."""

    def has(self, shard: int, step: int, digest: bytes) -> bool:
        """Return whether a shard's state of this digest at a step is there."""

    def write(self, shard: int, step: int, data: bytes) -> None:
        """Keep the state of a shard at a step, durably."""

    def read(self, shard: int, step: int) -> bytes:
        """Return the state of a shard at a step."""

    def drop_before(self, shard: int, step: int) -> None:
        """Forget what is older than a step."""


@dataclass(frozen=True, slots=True)
class Terms:
    """What every request of a run to advance a shard carries.

    Attributes:
        run, epoch: of the coordinator.
        settings: JSON of ``ArenaSettings`` of each arena, by its island.
    """

    run: str
    epoch: int
    settings: Mapping[int, bytes]


@dataclass(frozen=True, slots=True)
class Drift:
    """A shard went on by a worker of another platform.

    Attributes:
        island: whose shard.
        step: the first that it reached there.
        before, after: the platforms.
        worker: who it was.
    """

    island: int
    step: int
    before: str
    after: str
    worker: str

    @property
    def record(self) -> Record:
        """Its row."""
        return Record("drifts", asdict(self))

    def __str__(self) -> str:
        return (
            f"arena {self.island}: goes on to step {self.step} by {self.worker} on "
            f"{self.after}, before that on {self.before}: from here on this run is "
            "another one than on one platform"
        )


@dataclass(slots=True)
class _Past:
    """What became of a shard.

    Its state at ``step`` is that of the newest snapshot, at ``base`` (0 is the empty
    arena), after ``history``. ``platform`` is that of the last advance, empty before
    the first; ``places`` tells who lived after it, and where.
    """

    step: int = 0
    platform: str = ""
    digest: bytes = b""
    base: int = 0
    history: list[PastAdvance] = field(default_factory=list)
    places: dict[BirthId, Vector] = field(default_factory=dict)
    asked: AdvanceShard | None = None
    wants_snapshot: bool = False

    def drifts_to(self, platform: str) -> bool:
        """Return whether a platform is another than that of the last advance."""
        return self.platform not in ("", platform)

    def completed(self, advance: Advance) -> Advance:
        """Return the first advance after a drift, with those who did not outlive it.

        What lived there and comes to its end on the way here is told of by nobody.
        """
        assert self.asked is not None
        told = {one.birth for one in advance.judgements}
        told.update(one.birth for one in advance.casualties)
        told.update(self.asked.changes.removals)
        lost = tuple(
            Casualty(birth, self.step, "lost in a drift between platforms", place)
            for birth, place in self.places.items()
            if birth not in told
        )
        return replace(advance, casualties=lost + advance.casualties)


class Advances:
    """The advances of all arenas of a run.

    Attributes:
        malformed: answers that did not decode or did not fit their question.
    """

    def __init__(
        self, terms: Terms, snapshot_store: SnapshotStore, fleet: Fleet
    ) -> None:
        """Know of no shard yet.

        Args:
            terms: of the run.
            snapshot_store: keeps the snapshots.
            fleet: whose workers hold the shards.
        """
        self.malformed = 0
        self._terms = terms
        self._snapshot_store = snapshot_store
        self._fleet = fleet
        self._pasts: dict[int, _Past] = {}
        # A shard has its island's number here and another one in the fleet.
        self._numbers: dict[int, int] = {}
        self._islands: dict[int, int] = {}
        self._answers: dict[int, tuple[AdvanceAnswer, int]] = {}
        self._came: list[Advanced] = []
        self._refusal: JobRefused | None = None

    @property
    def waiting(self) -> dict[int, str]:
        """Platforms of the shards that wait for a worker; "" is any platform."""
        return {
            self._islands[number]: platform
            for number, platform in self._fleet.shards.waiting.items()
            if number in self._islands
        }

    def is_of(self, run: str, epoch: int) -> bool:
        """Return whether the advances are those of a run's incarnation."""
        return (run, epoch) == (self._terms.run, self._terms.epoch)

    def holder(self, shard: int) -> str:
        """Return which worker holds a shard; empty if none does."""
        return self._fleet.shards.holder(self._number(shard))

    def step(self, shard: int) -> int:
        """Return the step at which a shard stands."""
        return self._past(shard).step

    def past(self, shard: int) -> Rebuild:
        """Return how a shard came to be what it is."""
        past = self._past(shard)
        base = self._snapshot_store.read(shard, past.base) if past.base else b""
        return Rebuild(base, tuple(past.history))

    def note(self, command: AdvanceShard) -> None:
        """Remember what an arena asks for; ``request`` asks for it."""
        self._past(command.island).asked = command

    def request(self, shard: int) -> None:
        """Have the advance that was noted made, if one was."""
        if self._past(shard).asked is not None:
            self._fleet.advance(self._number(shard))

    def wish_snapshot(self, shard: int) -> None:
        """Have the state kept at the end of the next advance that is handed out."""
        self._past(shard).wants_snapshot = True

    def take(self, event: Advanced) -> Drift | None:
        """Remember what an advance came to, now that the journal has it.

        Returns:
            The drift, if it was made on another platform than the one before.

        Raises:
            UnexpectedEvent: no such advance was asked for.
        """
        past, advance = self._past(event.island), event.advance
        asked = past.asked
        if asked is None or asked.number != event.number:
            raise UnexpectedEvent(f"no such advance was asked for: {event}")
        past.asked = None
        past.step, past.digest = advance.step, advance.digest
        agent, platform = event.provenance.agent, event.provenance.platform
        drift: Drift | None = None
        if past.drifts_to(platform):
            before = past.platform
            drift = Drift(event.island, advance.step, before, platform, agent)
        past.platform = platform
        past.history.append(PastAdvance(asked.changes, asked.until, advance.digest))
        past.places = {one.birth: one.place for one in advance.judgements}
        if self._snapshot_store.has(event.island, past.step, past.digest):
            past.base, past.history = past.step, []
            self._snapshot_store.drop_before(event.island, past.step)
        self._fleet.place(self._number(event.island), platform)
        return drift

    def come(self) -> list[Advanced]:
        """Return the advances that were done since the last call.

        Their snapshots are in the vault.

        Raises:
            JobRefused: several workers cannot make an advance.
        """
        if self._refusal is not None:
            raise self._refusal
        came, self._came = self._came, []
        return came

    def release(self) -> None:
        """Let the workers have room for others' shards."""
        for number in self._islands:
            self._fleet.release(number)
        self._numbers, self._islands = {}, {}

    def _past(self, shard: int) -> _Past:
        return self._pasts.setdefault(shard, _Past())

    def _number(self, shard: int) -> int:
        """Return the number of a shard in the fleet."""
        if shard not in self._numbers:
            number = self._fleet.new_shard(self)
            self._numbers[shard], self._islands[number] = number, shard
        return self._numbers[shard]

    def settle(self, command: ShardDone | ShardFailed) -> None:
        """Keep the end of an advance until ``come``."""
        shard = self._islands[command.shard]
        if isinstance(command, ShardDone):
            self._came.append(self._accepted(shard, command.agent))
            return
        self._refusal = JobRefused(
            f"arena {shard}: several workers cannot advance it, the last of them "
            f"{command.agent}: {command.reason}; mend that and resume"
        )

    def payload(self, command: AssignShard) -> bytes:
        """Return the request that a worker is handed."""
        shard = self._islands[command.shard]
        past = self._past(shard)
        assert past.asked is not None
        is_drift = past.drifts_to(self._fleet.shards.platform(command.agent))
        # From a drift on, nothing of before it is ever done again.
        wants_snapshot = past.asked.wants_snapshot or past.wants_snapshot or is_drift
        past.wants_snapshot = False
        past.asked = replace(past.asked, wants_snapshot=wants_snapshot)
        rebuild: Rebuild | None = None
        if command.is_whole:
            base = past.base and self._snapshot_store.read(shard, past.base)
            living = tuple(past.places) if is_drift else None
            rebuild = Rebuild(base or b"", tuple(past.history), living)
        return encode_advance_request(
            AdvanceRequest(
                run=self._terms.run,
                epoch=self._terms.epoch,
                number=command.number,
                settings=self._terms.settings[shard],
                shard=shard,
                from_step=past.step,
                from_digest=past.digest,
                changes=past.asked.changes,
                until=past.asked.until,
                wants_snapshot=wants_snapshot,
                rebuild=rebuild,
            ),
            plugins_of(self._terms.settings[shard]),
        )

    def understood(self, event: Returned) -> ShardReturned:
        """Return what a worker's word means; one of no use is its error."""
        if event.outcome != "ok":
            return ShardReturned(event.number, event.outcome, event.reason)
        try:
            answer = decode_advance_answer(event.answer)
            self._check(answer, event)
            advance = answer.advance
            if advance is None:
                return ShardReturned(event.number, "stateless")
            island = self._island(event)
            poses, rows = place_poses(advance.poses, island)
            answer = replace(answer, advance=replace(advance, poses=poses))
        except MalformedMessage as error:
            self.malformed += 1
            return ShardReturned(event.number, "error", str(error))
        self._answers[island] = (answer, rows)
        return ShardReturned(event.number, "done")

    def _check(self, answer: AdvanceAnswer, event: Returned) -> None:
        """Raise unless an answer is to its question."""
        asked = self._past(self._island(event)).asked
        assert asked is not None
        expected = (self._terms.epoch, event.number)
        if (answer.epoch, answer.number) != expected:
            raise MalformedMessage(
                f"answer must be to (epoch, job) {expected}, got "
                f"{(answer.epoch, answer.number)}"
            )
        if answer.advance is None:
            return
        if answer.advance.step != asked.until:
            raise MalformedMessage(
                f"advance: must reach step {asked.until}, got {answer.advance.step}"
            )
        if asked.wants_snapshot and not answer.snapshot:
            raise MalformedMessage("advance: a snapshot was wanted, got none")

    def _island(self, event: Returned) -> int:
        """Return whose advance came back."""
        return self._islands[self._fleet.shards.shard_of(event.number)]

    def _accepted(self, shard: int, agent: str) -> Advanced:
        """Return an advance that is done, its snapshot in the vault."""
        answer, rows = self._answers.pop(shard)
        asked, advance = self._past(shard).asked, answer.advance
        assert asked is not None
        assert advance is not None
        if answer.snapshot:
            self._snapshot_store.write(shard, advance.step, answer.snapshot)
        platform = self._fleet.shards.platform(agent)
        if self._past(shard).drifts_to(platform):
            advance = self._past(shard).completed(advance)
        signed = Provenance(agent, platform, answer.wall_s)
        return Advanced(shard, asked.number, advance, rows, signed)


def place_poses(columns: bytes, island: int) -> tuple[bytes, int]:
    """Return the poses of an arena, immigrants told from natives, and their number.

    Args:
        columns: Arrow IPC stream; ``island`` is where each was born.
        island: where they live.

    Raises:
        MalformedMessage: the columns are none of poses.
    """
    poses = read_columns("poses", columns)
    born = poses["island"]
    if pa.compute.all(pa.compute.equal(born, island), min_count=0).as_py():
        return columns, poses.num_rows
    is_foreign = pa.compute.not_equal(born, island)
    nobody = pa.scalar(None, pa.int32())
    schema = poses.schema
    here = pa.repeat(pa.scalar(island, pa.int32()), poses.num_rows)
    poses = poses.set_column(
        schema.get_field_index("birth_island"),
        schema.field("birth_island"),
        pa.compute.if_else(is_foreign, born, nobody),
    ).set_column(schema.get_field_index("island"), schema.field("island"), here)
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, schema) as writer:
        writer.write_table(poses)
    return bytes(sink.getvalue().to_pybytes()), poses.num_rows
