"""The advances of a run's arenas: asked of who holds the shard, and remembered.

What a shard was told since its newest snapshot is kept, so that another worker can
rebuild its state. Nothing here decides what happens in an arena.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Protocol

from coordinator.events import (
    Advanced,
    AdvanceShard,
    DispatchEvent,
    Joined,
    Left,
    Returned,
    Ticked,
)
from coordinator.shards import (
    Accept,
    Came,
    GiveUp,
    Hand,
    Placed,
    ShardCommand,
    ShardDispatch,
    Wanted,
)
from schema.arena_codec import (
    AdvanceAnswer,
    AdvanceRequest,
    PastAdvance,
    Rebuild,
    decode_advance_answer,
    encode_advance_request,
)
from schema.errors import JobRefused, MalformedMessage, UnexpectedEvent
from schema.evaluation import Provenance
from schema.tables import read_columns


class Vault(Protocol):
    """Where snapshots of shards are kept."""

    def has(self, shard: int, step: int) -> bool:
        """Return whether the state of a shard at a step is there."""

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
        settings: JSON of ``ArenaSettings``.
    """

    run: str
    epoch: int
    settings: bytes


@dataclass(slots=True)
class _Past:
    """What became of a shard.

    Its state at ``step`` is that of the newest snapshot, at ``base`` (0 is the empty
    arena), after ``history``.
    """

    step: int = 0
    digest: bytes = b""
    base: int = 0
    history: list[PastAdvance] = field(default_factory=list)
    asked: AdvanceShard | None = None
    wants_snapshot: bool = False


class Advances:
    """The advances of all arenas of a run.

    Attributes:
        dispatch: who holds which shard.
        malformed: answers that did not decode or did not fit their question.
    """

    def __init__(
        self,
        terms: Terms,
        vault: Vault,
        *,
        numbers: Iterator[int],
        send: Callable[[int, str, bytes], None],
    ) -> None:
        """Know of no shard yet.

        Args:
            terms: of the run.
            vault: keeps the snapshots.
            numbers: of jobs, each used once.
            send: takes number, agent and payload of a job.
        """
        self.dispatch = ShardDispatch(numbers)
        self.malformed = 0
        self._terms = terms
        self._vault = vault
        self._send = send
        self._pasts: dict[int, _Past] = {}
        self._platforms: dict[str, str] = {}
        self._answers: dict[int, tuple[AdvanceAnswer, int]] = {}

    def step(self, shard: int) -> int:
        """Return the step at which a shard stands."""
        return self._past(shard).step

    def note(self, command: AdvanceShard) -> None:
        """Remember what an arena asks for; ``request`` asks for it."""
        self._past(command.island).asked = command

    def request(self, shard: int) -> None:
        """Have the advance that was noted made, if one was."""
        if self._past(shard).asked is not None:
            self._obey(self.dispatch.handle(Wanted(shard)))

    def wish_snapshot(self, shard: int) -> None:
        """Have the state kept at the end of the next advance that is handed out."""
        self._past(shard).wants_snapshot = True

    def take(self, event: Advanced) -> None:
        """Remember what an advance came to, now that the journal has it.

        Raises:
            UnexpectedEvent: no such advance was asked for.
        """
        past, advance = self._past(event.island), event.advance
        asked = past.asked
        if asked is None or asked.number != event.number:
            raise UnexpectedEvent(f"no such advance was asked for: {event}")
        past.asked = None
        past.step, past.digest = advance.step, advance.digest
        past.history.append(PastAdvance(asked.changes, asked.until, advance.digest))
        if self._vault.has(event.island, past.step):
            past.base, past.history = past.step, []
            self._vault.drop_before(event.island, past.step)
        platform = event.provenance.platform
        self.dispatch.handle(Placed(event.island, platform))

    def tell(self, event: DispatchEvent) -> list[Advanced]:
        """Take news of workers and of jobs; return the advances that are done.

        Their snapshots are in the vault. News of other jobs changes nothing.

        Raises:
            JobRefused: several workers cannot make an advance.
        """
        match event:
            case Joined():
                self._platforms[event.agent] = event.platform
                return self._obey(self.dispatch.handle(event))
            case Left() | Ticked():
                return self._obey(self.dispatch.handle(event))
            case Returned() if self.dispatch.has_out(event.number):
                return self._obey(self.dispatch.handle(self._understood(event)))
        return []

    def _past(self, shard: int) -> _Past:
        return self._pasts.setdefault(shard, _Past())

    def _obey(self, commands: list[ShardCommand]) -> list[Advanced]:
        done: list[Advanced] = []
        for command in commands:
            match command:
                case Hand():
                    self._send(command.number, command.agent, self._payload(command))
                case Accept():
                    done.append(self._accepted(command))
                case GiveUp():
                    raise JobRefused(
                        f"arena {command.shard}: several workers cannot advance it, "
                        f"the last of them {command.agent}: {command.reason}; "
                        "mend that and resume"
                    )
        return done

    def _payload(self, command: Hand) -> bytes:
        past = self._past(command.shard)
        assert past.asked is not None
        wants_snapshot = past.asked.wants_snapshot or past.wants_snapshot
        past.wants_snapshot = False
        past.asked = replace(past.asked, wants_snapshot=wants_snapshot)
        rebuild: Rebuild | None = None
        if command.is_whole:
            base = past.base and self._vault.read(command.shard, past.base)
            rebuild = Rebuild(base or b"", tuple(past.history))
        return encode_advance_request(
            AdvanceRequest(
                run=self._terms.run,
                epoch=self._terms.epoch,
                number=command.number,
                settings=self._terms.settings,
                shard=command.shard,
                from_step=past.step,
                from_digest=past.digest,
                changes=past.asked.changes,
                until=past.asked.until,
                wants_snapshot=wants_snapshot,
                rebuild=rebuild,
            )
        )

    def _understood(self, event: Returned) -> Came:
        """Return what a worker's word means; one of no use is its error."""
        if event.outcome != "ok":
            return Came(event.number, event.outcome, event.reason)
        try:
            answer = decode_advance_answer(event.answer)
            self._check(answer, event)
            advance = answer.advance
            if advance is None:
                return Came(event.number, "stateless")
            rows = read_columns("poses", advance.poses).num_rows
        except MalformedMessage as error:
            self.malformed += 1
            return Came(event.number, "error", str(error))
        self._answers[self.dispatch.shard_of(event.number)] = (answer, rows)
        return Came(event.number, "done")

    def _check(self, answer: AdvanceAnswer, event: Returned) -> None:
        """Raise unless an answer is to its question."""
        asked = self._past(self.dispatch.shard_of(event.number)).asked
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

    def _accepted(self, command: Accept) -> Advanced:
        """Return an advance that is done, its snapshot in the vault."""
        answer, rows = self._answers.pop(command.shard)
        asked, advance = self._past(command.shard).asked, answer.advance
        assert asked is not None
        assert advance is not None
        if answer.snapshot:
            self._vault.write(command.shard, advance.step, answer.snapshot)
        signed = Provenance(
            command.agent, self._platforms[command.agent], answer.wall_s
        )
        return Advanced(command.shard, asked.number, advance, rows, signed)
