"""A process of the same machine that forges control messages beside a run."""

import json
import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import zenoh

from schema.agent.network import CANCELLED, FENCED, UNFIT, client_config
from schema.agent.platform_tag import wire_version
from schema.agent.service import session_config
from schema.agent.topics import Member, Role, agents_alive, member_of
from schema.wire import revolve_pb2 as pb

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

    def agents(self, role: Role) -> list[Member]:
        """Return the agents of the run that are alive."""
        tokens = self.session.liveliness().get(agents_alive("default", role))
        return [member_of(str(each.ok.key_expr)) for each in tokens if each.ok]

    def claim(self, epoch: int) -> None:
        """Claim to each agent to be the run's coordinator of an epoch."""
        data = pb.Request(run=self.run, epoch=epoch, number=1).SerializeToString()
        for role in ("worker", "analyzer"):
            for member in self.agents(role):
                self.session.get(member.jobs, payload=data, consolidation=_NOW)

    def overhear(self, act: Callable[[str, bytes], None]) -> None:
        """Call a function with the key and the request of each job that is sent."""

        def hear(query: zenoh.Query) -> None:
            with query:
                assert query.payload is not None
                act(str(query.key_expr), query.payload.to_bytes())

        self.serve("revolve/**/jobs", zenoh.handlers.Callback(hear))

    def cancel(self) -> None:
        """Cancel each job when it is sent."""

        def act(key: str, data: bytes) -> None:
            self.session.put(key.replace("/jobs", "/cancelled"), data)

        self.overhear(act)

    def claim_as(self, epoch: int) -> None:
        """Claim to be the run's coordinator of an epoch whenever a job is sent."""
        data = pb.Request(run=self.run, epoch=epoch, number=1).SerializeToString()

        def act(key: str, seen: bytes) -> None:
            if seen != data:
                self.session.get(key, payload=data, consolidation=_NOW)

        self.overhear(act)

    def replace_by_deadly(self, first: int, times: int) -> None:
        """Send endless requests in the name of one evaluation to its workers.

        Args:
            first: the first evaluation with at least this number is chosen.
            times: how often, each time that the job is given to a worker.
        """
        chosen: list[int] = []

        def act(key: str, data: bytes) -> None:
            request = pb.Request.FromString(data)
            if "/w/" not in key or request.number < first or request.steps >= _ENDLESS:
                return
            if request.number in chosen[:1] or not chosen:
                chosen.append(request.number)
                if len(chosen) <= times:
                    request.steps = _ENDLESS
                    endless = request.SerializeToString()
                    self.session.get(key, payload=endless, consolidation=_NOW)

        self.overhear(act)

    def answer_for(self, key: str, answer: bytes, error: str) -> None:
        """Reply to all jobs of a key expression in the agents' names."""

        def reply(query: zenoh.Query) -> None:
            with query:
                if error:
                    query.reply_err(error)
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
                fake = Member("default", "worker", f"{member.name[:-8]}{number:08}")
                config = session_config(client_config(self._address), fake)
                session = self._stack.enter_context(zenoh.open(config))
                info = pb.AgentInfo(
                    agent=fake.name,
                    kind="worker",
                    slots=1,
                    shards=1,
                    cores=1,
                    version=wire_version(),
                )
                info.deaths.add(
                    agent=member.name,
                    run=self.run,
                    epoch=1,
                    number=number,
                    cause="SIGSEGV",
                )
                data = info.SerializeToString()

                def tell(
                    query: zenoh.Query, key: str = fake.info, data: bytes = data
                ) -> None:
                    with query:
                        query.reply(key, data)

                told = zenoh.handlers.Callback(tell)
                self._held += [
                    session.declare_queryable(fake.info, told, complete=True),
                    session.liveliness().declare_token(fake.alive),
                ]


@contextmanager
def attacker_at(folder: Path) -> Iterator[Attacker]:
    """Open an attacker's session at the hub of a run's folder."""
    with ExitStack() as stack:
        address = (folder / "address").read_text().strip()
        yield Attacker(folder, address, stack)


FORGED_ANSWER = pb.Answer(
    epoch=1, number=1, evaluation=pb.Evaluation(fitness=99.0, simulated_s=1.0)
).SerializeToString()
REASONS = {
    "fenced": f"{FENCED}epoch 1 is over: epoch 9 has begun",
    "unfit": f"{UNFIT}has no plug-in 'x'",
    "cancelled": CANCELLED,
    "error": "\x1b[2J cannot",
}
