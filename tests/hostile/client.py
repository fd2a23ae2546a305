"""Program: a peer that speaks our messages and misbehaves in every role, from a seed.

It hears the jobs, the news and the poses of a run through a session of its own, and
sends random and mutated messages, and valid ones of the wrong role, run, epoch or
number, on every key of every role. It joins as worker, analyzer and coordinator that
answer late, twice, wrongly or never. It gives no valid order, and no answer that a
correct agent could give: without TLS, nothing stops those (docs/security.md).

Prints JSON: how many messages it sent of each kind, and what came back.
"""

import argparse
import json
import sys
import threading
import time
from collections import Counter, defaultdict, deque
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path

import zenoh
from msgspec.structs import replace

from schema.agent.machine import wire_version
from schema.agent.network import CANCELLED, FENCED, UNFIT, client_config
from schema.agent.service import session_config
from schema.agent.supervisor import stop_on_signals
from schema.agent.topics import FleetMember, Role, key_of_all, member_of
from schema.errors import MalformedMessage
from schema.limits import ADVANCE_REQUEST_BYTES, BUNDLE_BYTES, MOST_EPOCH
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.wire.codec import decode, encode, fingerprint
from schema.wire.messages import (
    AgentInfo,
    Answer,
    Call,
    Crash,
    Failure,
    Jobs,
    Reply,
    Request,
    RunningJob,
    StateMissing,
)
from schema.wire.operator import (
    GetStatus,
    ListRobots,
    OperatorRequest,
    PauseArena,
    RemoveRobot,
)
from tests.hostile.decoders import update
from tests.hostile.mutation import Mutator

_NOW = zenoh.ConsolidationMode.NONE
_PATIENCE_S = 120.0
"""Time without a hub after which the run is over [s]."""
_BETWEEN_LOOKS = 500
"""Messages after which it looks for the fleet again."""
_OPEN = 200
"""Most queries that wait for replies at a time."""
_KEPT = 30
"""Messages of each kind that are kept to be mutated."""
_BUNDLED = 0.8
"""Share of jobs and answers that are bundled as they should be."""
_LIARS = 2
"""Agents of each role that join."""
_NOBODY = "no-such-run-of-anybody"
_ROLES: tuple[Role, ...] = ("worker", "analyzer", "coordinator")
_FAR = 10**12
"""Number of a job that no run reaches."""
_KINDS = (
    *("jobs", "jobs", "jobs", "command", "command", "events", "events"),
    *("cancelled", "info", "state", "arena", "token", "anywhere"),
)
"""Ends of keys of what it sends; frequent ones several times."""
_ENDS = {
    "arena": ("arena/0/pose", "arena/1/pose", f"arena/{2**32}/pose"),
    "anywhere": ("*", "jobs", "info", "alive", "state", "command", "x/y"),
}
_PUBLISHED = ("events", "cancelled", "arena")


class HostileClient:
    """Sends hostile messages through sessions at a hub."""

    def __init__(
        self,
        seed: int,
        address: str,
        stack: ExitStack,
        sent: Counter[str],
        came: Counter[str],
    ) -> None:
        """Open a session and listen.

        The threads of the network draw from the next seed. The numbers of messages
        that it sent and that came, by kind, increase.
        """
        self.sent, self.came = sent, came
        self._mutator = Mutator(seed)
        self._replier = Mutator(seed + 1)
        self._lock = threading.Lock()
        self._stack = stack
        self._address = address
        self._free = threading.Semaphore(_OPEN)
        self._heard: defaultdict[str, deque[bytes]] = defaultdict(
            lambda: deque(_samples(), maxlen=_KEPT)
        )
        self._held: deque[zenoh.Query] = deque(maxlen=_KEPT)
        self._kept: list[object] = []
        self._session = self._open(client_config(address))
        self._liars: list[FleetMember] = []
        self._members: list[FleetMember] = []
        self._listen()

    def _open(self, config: str, member: FleetMember | None = None) -> zenoh.Session:
        made = (
            session_config(config, member)
            if member
            else zenoh.Config.from_json5(config)
        )
        return self._stack.enter_context(zenoh.open(made))

    def _listen(self) -> None:
        """Hear all that is sent; reply to what is asked."""
        for key in ("events", "arena/*/pose", "cancelled"):
            heard = zenoh.handlers.Callback(self._hear)
            self._kept.append(
                self._session.declare_subscriber(f"revolve/**/{key}", heard)
            )
        for end in ("jobs", "info", "command", "state"):
            asked = zenoh.handlers.Callback(self._answer_for_another)
            self._kept.append(
                self._session.declare_queryable(
                    f"revolve/**/{end}", asked, complete=True
                )
            )

    def join(self) -> None:
        """Join as agents and as a coordinator."""
        for role in _ROLES:
            for number in range(_LIARS):
                liar = FleetMember("default", role, f"liar-{role}-{number}.{number:08}")
                session = self._open(client_config(self._address), liar)
                for key in (liar.jobs, liar.info, liar.command, liar.state):
                    lie = zenoh.handlers.Callback(self._lie_as(liar))
                    self._kept.append(
                        session.declare_queryable(key, lie, complete=True)
                    )
                token = session.liveliness().declare_token(liar.alive)
                self._kept.append(token)
                self._liars.append(liar)

    def look(self) -> int:
        """Look for the processes of the fleet; return how many there are."""
        found = []
        for role in _ROLES:
            for each in self._session.liveliness().get(
                key_of_all("default", role, "alive")
            ):
                if each.ok:
                    try:
                        found.append(member_of(str(each.ok.key_expr)))
                    except MalformedMessage:
                        continue
        self._members = sorted(set(found) - set(self._liars), key=lambda m: m.alive)
        return len(self._members)

    def send(self) -> None:
        """Send one hostile message: a token, or bytes on a key of a process."""
        draw = self._mutator.random
        member = draw.choice([*self._members, *self._members, *self._liars])
        kind = draw.choice(_KINDS)
        if kind == "token":
            self._token(member)
            return
        prefix = member.alive.removesuffix("/alive")
        key = f"{prefix}/{draw.choice(_ENDS.get(kind, (kind,)))}"
        data = self._message(kind)
        if kind in _PUBLISHED or (kind == "anywhere" and draw.random() < 0.5):
            self._put(key, data, kind)
        else:
            sender = draw.choice((b"", b"x", draw.randbytes(8)))
            self._get(key, data, f"{kind} to {member.role}", sender)

    def _message(self, kind: str) -> bytes:
        """Return a mutated message, or a valid one that no process waits for."""
        draw = self._mutator.random
        heard = list(self._heard[kind]) or _samples()
        if draw.random() < 0.2 and kind == "jobs":
            return self._renamed(draw.choice(heard))
        if draw.random() < 0.2 and kind == "cancelled":
            return fingerprint(draw.choice(list(self._heard["jobs"]) or _samples()))
        if draw.random() < 0.1 and kind == "events":
            return encode(update())
        return self._mutator.message(_ORDERS if kind == "command" else heard)

    def _hear(self, sample: zenoh.Sample) -> None:
        kind = str(sample.key_expr).rpartition("/")[2].replace("pose", "arena")
        if len(sample.payload) < 100_000:
            self._heard[kind].append(sample.payload.to_bytes())

    def _answer_for_another(self, query: zenoh.Query) -> None:
        """Reply in the name of the process that was asked, or never."""
        key = str(query.key_expr)
        kind = key.rpartition("/")[2]
        with self._lock:
            if query.payload is not None and kind == "jobs" and "liar" not in key:
                with suppress(MalformedMessage):
                    jobs = decode(Jobs, query.payload.to_bytes(), BUNDLE_BYTES)
                    self._heard[kind].extend(jobs)
            self._reply(query, kind, "foreign")

    def _lie_as(self, liar: FleetMember) -> Callable[[zenoh.Query], None]:
        """Return a function that replies as an agent that joined."""

        def lie(query: zenoh.Query) -> None:
            kind = str(query.key_expr).rpartition("/")[2]
            with self._lock:
                if kind == "info" and self._replier.random.random() < 0.5:
                    with query:
                        query.reply(liar.info, _info(liar))
                    self.sent["valid info"] += 1
                else:
                    self._reply(query, kind, "liar")

        return lie

    def _reply(self, query: zenoh.Query, kind: str, who: str) -> None:
        draw = self._replier.random
        choice = draw.randrange(6)
        if choice == 0:
            self._held.append(query)  # never answered, or when others are held
            return
        with query:
            key = query.key_expr
            # An error of an agent that joined counts: several stop a run.
            if choice == 1 and who == "foreign":
                reason = (FENCED, UNFIT, CANCELLED, "\x1b[2J", "")[draw.randrange(5)]
                query.reply_err(reason.encode() + draw.randbytes(draw.randrange(20)))
                self.sent[f"{who} error to {kind}"] += 1
                return
            times = 2 if choice == 2 else 1
            for _ in range(times):
                data = self._replier.message(_answers(kind))
                if kind == "jobs" and draw.random() < _BUNDLED:
                    data = encode([Reply(0, data)])
                query.reply(key, data)
                self.sent[f"{who} reply to {kind}"] += 1

    def _get(self, key: str, data: bytes, kind: str, sender: bytes = b"") -> None:
        if key.endswith("/jobs") and self._mutator.random.random() < _BUNDLED:
            data = encode([data])
        self._free.acquire()
        self.sent[kind] += 1

        def take(reply: zenoh.Reply) -> None:
            self.came["answer" if reply.ok is not None else "refusal"] += 1

        self._session.get(
            key,
            zenoh.handlers.Callback(take, self._free.release, indirect=False),
            payload=data,
            attachment=sender,
            target=zenoh.QueryTarget.ALL,
            consolidation=_NOW,
            timeout=2.0,
        )

    def _put(self, key: str, data: bytes, kind: str) -> None:
        self.sent[kind] += 1
        self._session.put(key, data, congestion_control=zenoh.CongestionControl.BLOCK)

    def _renamed(self, data: bytes) -> bytes:
        """Return a request of another coordinator, without what takes time to do."""
        draw = self._mutator.random
        try:
            request = decode(Request, data, ADVANCE_REQUEST_BYTES)
        except MalformedMessage:  # a sample that is no request
            return data
        # No type is checked when a message is made.
        return encode(
            replace(
                request,
                run=draw.choice((request.run, "", "x", "y" * 6000)),
                epoch=draw.choice((0, 1, 2, MOST_EPOCH, MOST_EPOCH + 1, 2**64 - 1)),
                number=draw.choice((request.number, _FAR)),
                settings=draw.choice((b"", b"{}", request.settings[:-1])),
                plugins=draw.choice(("", "os:system=0", "x" * 20_000)),
            )
        )

    def _token(self, member: FleetMember) -> None:
        """Declare a token of another role, of a process that is there, or of none."""
        draw = self._mutator.random
        key = draw.choice(
            (
                member.alive,
                member.alive.replace("/w/", "/an/"),
                member.alive.replace("/an/", "/w/"),
                f"revolve/default/w/{draw.randbytes(4).hex()}/alive",
                f"revolve/default/co/{draw.randbytes(4).hex()}/alive",
                "revolve/default/w/" + "x" * 200 + "/alive",
            )
        )
        self.sent["token"] += 1
        token = self._session.liveliness().declare_token(key)
        token.undeclare()  # type: ignore[no-untyped-call]


def _info(liar: FleetMember) -> bytes:
    """Return a valid description; its predecessors died of the jobs of others."""
    info = AgentInfo(
        agent=liar.name,
        kind=liar.role,
        slots=1,
        platform="liar",
        version=wire_version(),
        deaths=(Crash(RunningJob("w", "run", 1, 1), "SIGSEGV"),),
        quiet_s=0.1,
    )
    return encode(info)


def _samples() -> list[bytes]:
    return [encode(Request("run", 1, _FAR, Call(b"\xc0"), b"{}"))]


def _answers(kind: str) -> list[bytes]:
    """Return answers to no job, an unknown agent's description, or unasked replies."""
    if kind == "info":
        return [_info(FleetMember("default", "worker", "unknown"))]
    if kind in ("command", "state"):
        return [encode(update())]
    results = (Evaluation(99.0, 0.0, 0.0, 1.0), Failure("diverged"), StateMissing())
    return [encode(Answer(MOST_EPOCH, _FAR, 0.0, result)) for result in results]


_ORDERS = [
    encode(OperatorRequest("id", 0, action, _NOBODY))
    for action in (ListRobots(), GetStatus(), PauseArena(), RemoveRobot(BirthId(0, 1)))
]


def main() -> None:
    """Read the arguments; send until all is sent or a signal comes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--messages", type=int, required=True)
    parser.add_argument("--connect", required=True, metavar="ADDRESS")
    parser.add_argument(
        "--progress", type=Path, help="file to create when half is sent"
    )
    chosen = parser.parse_args()
    stop = stop_on_signals()
    sent, came = Counter[str](), Counter[str]()
    seed, seen_s = chosen.seed, time.monotonic()

    def is_busy() -> bool:
        return not stop.is_set() and sum(sent.values()) < chosen.messages

    # A hub closes the links of a peer that floods it. Some of its sessions get no
    # answers after that: open new ones.
    while is_busy() and time.monotonic() < seen_s + _PATIENCE_S:
        with suppress(zenoh.ZError), ExitStack() as stack:
            client = HostileClient(seed, chosen.connect, stack, sent, came)
            client.join()
            while is_busy() and client.look():
                seen_s = time.monotonic()
                for _ in range(_BETWEEN_LOOKS):
                    client.send()
                is_half = 2 * sum(sent.values()) >= chosen.messages
                if is_half and chosen.progress is not None:
                    chosen.progress.touch()
        seed += 2
        stop.wait(0.5)
    json.dump({"sent": sent, "came": came}, sys.stdout, sort_keys=True)


if __name__ == "__main__":
    main()
