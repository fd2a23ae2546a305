"""Jobs from the network: the serving loop that workers and analyzers share.

An agent takes one job after the other from its own key; the next one already
waits within the process. The callbacks of the network only enqueue. Whatever a
peer sends, the loop goes on: bad requests are refused with a reason and counted.
"""

import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from queue import Empty, SimpleQueue

import zenoh
from google.protobuf.message import DecodeError

from schema import revolve_pb2 as pb
from schema.crew import stop_on_signals, stop_with_parent
from schema.errors import MalformedMessage, RevolveError
from schema.network import FENCED, Agent, client_config
from schema.platform_tag import our_version, platform_tag
from schema.topics import Member, check_name, unique_name

_POLL_S = 0.2
_RETRY_S = 0.3
_SAY_S = 5.0


def tell_user(line: str) -> None:
    """Write a line to standard error."""
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


@dataclass(slots=True)
class Tally:
    """What an agent did.

    Attributes:
        answered: jobs with an answer.
        refused: jobs with a reason why not, the malformed among them.
        malformed: requests that do not decode.
    """

    answered: int = 0
    refused: int = 0
    malformed: int = 0


class Outlet:
    """Where an agent publishes for those who watch: best effort, nothing waits."""

    def __init__(self) -> None:
        """Lead nowhere until there is a session."""
        self._session: zenoh.Session | None = None
        self._publishers: dict[str, zenoh.Publisher] = {}

    def lead_to(self, session: zenoh.Session | None) -> None:
        """Publish by a session from now on, or no more."""
        self._session = session
        self._publishers = {}

    def put(self, key: str, data: bytes) -> None:
        """Publish bytes; lost if nobody listens or the line is full."""
        if self._session is None:
            return
        publisher = self._publishers.get(key)
        if publisher is None:
            publisher = self._publishers[key] = self._session.declare_publisher(
                key,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.DATA_LOW,
            )
        publisher.put(data)


def serve(
    answer: Callable[[bytes], bytes],
    agent: Agent,
    stop: threading.Event,
    say: Callable[[str], None] = tell_user,
    outlet: Outlet | None = None,
) -> Tally:
    """Answer jobs until told to stop; wait for the hub as long as it takes.

    The job at hand is finished, the one behind it dropped: whoever asked gives it
    to somebody else.

    Args:
        answer: bytes of a ``Request`` to bytes of an ``Answer``; it raises if the
            request is bad.
        agent: who this is and where its hub is.
        stop: ends it; looked at between jobs.
        say: told, in one line, when there is no hub and when there is one again.
        outlet: publishes by this agent's session while there is one.

    Raises:
        NetworkError: a name or an address that is none.
    """
    check_name(agent.name, "name")
    check_name(agent.fleet, "fleet")
    config = client_config(agent.connect, agent.tls)
    server = _Server(answer, agent)
    hub = _Hub(agent.connect, say)
    zenoh.init_log_from_env_or("error")
    session = _open(config, hub, stop)
    if session is not None:
        with session:
            if outlet is not None:
                outlet.lead_to(session)
            _serve_session(session, server, hub, stop)
            if outlet is not None:
                outlet.lead_to(None)
    return server.tally


def own_agent(agent: Agent, index: int) -> Agent:
    """Return what one process of a crew calls itself and says of itself.

    Args:
        agent: of the whole crew.
        index: of the process.
    """
    return replace(
        agent,
        name=unique_name(f"{agent.name}-{index}"),
        platform=platform_tag(),
        version=our_version(),
    )


def serve_as_process(
    answer: Callable[[bytes], bytes],
    agent: Agent,
    index: int,
    outlet: Outlet | None = None,
) -> None:
    """Be one process of a crew: serve until asked to end, or left alone.

    Args:
        answer: as for ``serve``.
        agent: of this process, or of the whole crew if it has no version yet.
        index: of the process; the first one speaks for all.
        outlet: as for ``serve``.
    """
    stop = stop_on_signals()
    stop_with_parent(stop)
    own = agent if agent.version else own_agent(agent, index)
    say = tell_user if index == 0 else _keep_quiet
    tally = serve(answer, own, stop, say, outlet)
    if tally.refused:
        tell_user(
            f"{own.name} refused {tally.refused} requests, "
            f"{tally.malformed} of them malformed"
        )


def _keep_quiet(_line: str) -> None:
    """Let the first of the crew speak."""


def _open(config: str, hub: "_Hub", stop: threading.Event) -> zenoh.Session | None:
    """Return a session as soon as there is a hub; None if told to stop first."""
    while not stop.is_set():
        try:
            return zenoh.open(zenoh.Config.from_json5(config))
        except zenoh.ZError:
            hub.seen(is_there=False)
        stop.wait(_RETRY_S)
    return None


def _serve_session(
    session: zenoh.Session, server: "_Server", hub: "_Hub", stop: threading.Event
) -> None:
    me = server.member
    inbox: SimpleQueue[zenoh.Query] = SimpleQueue()
    take = zenoh.handlers.Callback(inbox.put, indirect=False)
    tell = zenoh.handlers.Callback(server.tell_info)
    # The keys first, the token last: whoever sees it may ask at once.
    with (
        session.declare_queryable(me.jobs, take, complete=True),
        session.declare_queryable(me.info, tell, complete=True),
        session.liveliness().declare_token(me.alive),
    ):
        hub.seen(is_there=True)
        while not stop.is_set():
            try:
                query = inbox.get(timeout=_POLL_S)
            except Empty:
                hub.seen(is_there=bool(session.info.routers_zid()))
                continue
            with query:
                server.answer_query(query)
    while not inbox.empty():
        with inbox.get():
            pass  # its end without a reply is the asker's news


@dataclass(slots=True)
class _Hub:
    """What the user knows of the hub."""

    address: str
    say: Callable[[str], None]
    is_there: bool = True
    said_s: float = 0.0

    def seen(self, *, is_there: bool) -> None:
        """Say what is new, and every few seconds that the hub is still missing."""
        now_s = time.monotonic()
        if is_there and not self.is_there:
            self.say(f"connected to {self.address}")
        if not is_there and (self.is_there or now_s - self.said_s >= _SAY_S):
            self.say(f"no coordinator at {self.address}; trying on, Ctrl-C ends")
            self.said_s = now_s
        self.is_there = is_there


@dataclass(slots=True)
class _Server:
    """Answers single queries; knows the newest coordinator of each run."""

    answer: Callable[[bytes], bytes]
    agent: Agent
    tally: Tally = field(default_factory=Tally)
    epochs: dict[str, int] = field(default_factory=dict)

    @property
    def member(self) -> Member:
        return Member(self.agent.fleet, self.agent.role, self.agent.name)

    def tell_info(self, query: zenoh.Query) -> None:
        """Say what this agent is."""
        agent = self.agent
        info = pb.AgentInfo(
            agent=agent.name,
            kind=agent.role,
            slots=agent.slots,
            platform=agent.platform,
            version=agent.version,
        )
        with query:
            query.reply(self.member.info, info.SerializeToString())

    def answer_query(self, query: zenoh.Query) -> None:
        """Reply with an answer, or with the reason why there is none."""
        payload = query.payload
        try:
            request = b"" if payload is None else payload.to_bytes()
            self._check_epoch(request)
            answer = self.answer(request)
        except RevolveError as error:
            self.tally.refused += 1
            self.tally.malformed += isinstance(error, MalformedMessage)
            query.reply_err(str(error))
        except Exception as error:  # noqa: BLE001 - a plug-in may raise anything
            self.tally.refused += 1
            query.reply_err(f"{type(error).__name__}: {error}")
        else:
            self.tally.answered += 1
            query.reply(self.member.jobs, answer)

    def _check_epoch(self, data: bytes) -> None:
        """Refuse a coordinator whose run another one has taken over.

        Raises:
            MalformedMessage: not a request's bytes, or one that names no run.
            RevolveError: an older epoch than the newest seen of its run.
        """
        try:
            request = pb.Request.FromString(data)
        except DecodeError as error:
            raise MalformedMessage(f"not the bytes of a Request: {error}") from None
        if not request.run:
            raise MalformedMessage("Request: names no run")
        newest = self.epochs.get(request.run, 0)
        if request.epoch < newest:
            raise RevolveError(
                f"{FENCED}epoch {request.epoch} of run {request.run} is over: "
                f"epoch {newest} has begun"
            )
        self.epochs[request.run] = request.epoch
