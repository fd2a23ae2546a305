"""A process of the same machine that forges control messages beside a run."""

import json
import socket
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import cycle
from pathlib import Path
from typing import Any

import zenoh
from msgspec.structs import replace

from schema.agent.network import CANCELLED, FENCED, UNFIT, client_config
from schema.agent.service import session_config
from schema.agent.topics import FleetMember, Role
from schema.limits import ADVANCE_REQUEST_BYTES, BUNDLE_BYTES
from schema.robot.results import Evaluation
from schema.wire.codec import decode, encode, fingerprint
from schema.wire.messages import (
    Answer,
    Call,
    Crash,
    Evaluate,
    Jobs,
    Request,
    RunningJob,
)
from tests.system.fleet import alive, introduce
from tests.system.workspace import address_of

_NOW = zenoh.ConsolidationMode.NONE
_ENDLESS = 10**9


def run_name(folder: Path) -> str:
    """Return the unique name of a run, as its jobs carry it."""
    nonce = json.loads((folder / "run.json").read_text())["nonce"]
    return f"{socket.gethostname()}:{nonce}:{folder.resolve()}"


class Attacker:
    """Forges messages through a session of its own at a run's hub."""

    def __init__(self, folder: Path, address: str, stack: ExitStack) -> None:
        self.run = run_name(folder)
        self._address = address
        self._stack = stack
        config = zenoh.Config.from_json5(client_config(address))
        self.session = stack.enter_context(zenoh.open(config))
        self._held: list[Any] = []

    def agents(self, role: Role) -> list[FleetMember]:
        """Return the agents of the run that are alive."""
        return alive(self.session, role)

    def claim(self, epoch: int) -> None:
        """Claim to each agent to be the run's coordinator of an epoch."""
        # A request that no agent can do.
        data = encode(Request(self.run, epoch, 1, Call(b"\xc0"), b""))
        for role in ("worker", "analyzer"):
            for member in self.agents(role):
                self.session.get(
                    member.jobs, payload=encode([data]), consolidation=_NOW
                )

    def overhear(self, act: Callable[[str, bytes], None]) -> None:
        """Call a function with the key and the request of each job that is sent."""

        def hear(query: zenoh.Query) -> None:
            with query:
                assert query.payload is not None
                for job in decode(Jobs, query.payload.to_bytes(), BUNDLE_BYTES):
                    act(str(query.key_expr), job)

        self.serve("revolve/**/jobs", zenoh.handlers.Callback(hear))

    def cancel(self) -> None:
        """Cancel each job when it is sent."""

        def act(key: str, data: bytes) -> None:
            self.session.put(key.replace("/jobs", "/cancelled"), fingerprint(data))

        self.overhear(act)

    def replace_by_deadly(self, first: int, times: int) -> None:
        """Send endless requests in the name of an evaluation to its workers.

        If a worker answers the true one before, a later evaluation is chosen.
        """
        sent = Counter[int]()

        def act(key: str, data: bytes) -> None:
            request = decode(Request, data, ADVANCE_REQUEST_BYTES)
            work = request.work
            if not isinstance(work, Evaluate) or work.steps >= _ENDLESS:
                return
            if request.number < first or times in sent.values():
                return
            sent[request.number] += 1
            endless = replace(request, work=replace(work, steps=_ENDLESS))
            data = encode([encode(endless)])
            self.session.get(key, payload=data, consolidation=_NOW)

        self.overhear(act)

    def answer_for(self, key: str, *replies: bytes | str) -> None:
        """Reply in the agents' names to all jobs of a key expression, in turns."""
        turns = cycle(replies)

        def reply(query: zenoh.Query) -> None:
            answer = next(turns)
            with query:
                if isinstance(answer, str):
                    query.reply_err(answer)
                else:
                    query.reply(query.key_expr, answer)

        self.serve(key, zenoh.handlers.Callback(reply))

    def keep_silent_for(self, key: str) -> None:
        """Take all queries of a key expression and never reply."""
        self.serve(key, zenoh.handlers.Callback(self._held.append, indirect=False))

    def serve(self, key: str, handler: Any) -> None:  # noqa: ANN401 - of Zenoh
        """Declare a queryable that claims to be complete."""
        self._held.append(self.session.declare_queryable(key, handler, complete=True))

    def declare(self, key: str) -> None:
        """Declare a liveliness token."""
        self._held.append(self.session.liveliness().declare_token(key))

    def report_deaths(self, numbers: range) -> None:
        """Join as successors of the run's workers that their jobs crashed."""
        for member in self.agents("worker"):
            for number in numbers:
                fake = FleetMember(
                    "default", "worker", f"{member.name[:-8]}{number:08}"
                )
                config = session_config(client_config(self._address), fake)
                session = self._stack.enter_context(zenoh.open(config))
                job = RunningJob(member.name, self.run, 1, number, bytes(8))
                crash = Crash(job, "SIGSEGV")
                self._held += [
                    introduce(session, fake, crash),
                    session.liveliness().declare_token(fake.alive),
                ]


@contextmanager
def attacker_at(folder: Path) -> Iterator[Attacker]:
    """Open an attacker's session at the hub of a run, as soon as it listens."""
    with ExitStack() as stack:
        yield Attacker(folder, address_of(folder), stack)


FALSE_REPLIES = (
    encode(Answer(1, 1, 0.0, Evaluation(99.0, 0.0, 0.0, 1.0))),
    f"{FENCED}epoch 1 is over: epoch 9 has begun",
    f"{UNFIT}has no plug-in 'x'",
    CANCELLED,
    "\x1b[2J cannot",
)
