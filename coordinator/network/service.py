"""The coordinator's end of the network: agents, jobs, answers, operators, viewers.

The network's threads only enqueue. One thread calls ``send`` and ``receive`` and gets
events in the order of their arrival.
"""

import ctypes
import json
import math
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from queue import Empty
from typing import Literal, Self

import zenoh

from coordinator.dispatch.events import AgentKind, DispatchEvent, Returned
from coordinator.dispatch.faults import FaultKind, PeerFaults
from coordinator.network.hub_service import watch_unlisted
from coordinator.network.membership import InfoQueue, Membership
from coordinator.network.migration_service import MigrationService
from coordinator.network.operator_service import Queries
from schema.agent.access import Certificate
from schema.agent.address import new_socket, parse_address
from schema.agent.inbox import Inbox
from schema.agent.log import tell_user, warn_user
from schema.agent.machine import wire_version
from schema.agent.network import (
    ASK_TIMEOUT_S,
    CANCELLED,
    DEFAULT_FLEET,
    FENCED,
    UNFIT,
    Tls,
    cannot_listen,
    client_config,
    hub_config,
)
from schema.agent.service import (
    HubWatch,
    Outlet,
    open_at_hub,
    open_session,
    session_config,
    why_no_hub,
)
from schema.agent.topics import FleetMember, check_name, key_of_all
from schema.errors import MalformedMessage, NetworkError
from schema.limits import (
    BUNDLE_BYTES,
    KIB,
    LONGEST_REASON,
    MOST_ASKED_INFOS,
    MOST_BUNDLED,
    printable,
)
from schema.wire.codec import decode, encode, fingerprint
from schema.wire.messages import Replies, Reply

_KINDS: tuple[AgentKind, ...] = ("worker", "analyzer")
_NOW = zenoh.ConsolidationMode.NONE
_MOST_EVENTS = 1000
_MOST_NEWS = 10_000
_LOOK_S = 1.0
_NEARLY = 0.99
# A job that is larger does not wait for others.
_LARGE = 64 * KIB
# Properties that are malformed are hardly better after a second.
_MALFORMED_SILENCES = 5
_THREAD = threading.local()


@dataclass(slots=True)
class _Asked:
    """A query to an agent: jobs that travel together, or one for its ``AgentInfo``.

    Any process can serve the agent's key. All that do get the query, so that none can
    keep it from the agent, and only replies of the agent's own session count.

    Attributes:
        open: numbers of the jobs without a reply, by their places; none for the info.
        wait_s: the longest that it takes [s].
    """

    member: FleetMember
    open: dict[int, int]
    inbox: "Inbox[_News]"
    wait_s: float
    asked_s: float = field(default_factory=time.monotonic)
    is_info: bool = field(init=False)
    _awaited: int = field(init=False)
    _has_stray: bool = False

    def __post_init__(self) -> None:
        self.is_info = not self.open
        self._awaited = max(1, len(self.open))

    def take(self, reply: zenoh.Reply) -> None:
        """Pass a reply on at once: another process may never end its own."""
        _keep_thread_state()
        replier = reply.replier_id
        took_s = time.monotonic() - self.asked_s
        if replier is None or (reply.ok is None and took_s >= self.wait_s):
            return  # of the engine itself or of the hub, after the wait
        if str(replier.zid) != self.member.session:
            self._pass_on("foreign")
        elif not self._awaited:
            self._pass_on("late")
        else:
            # Never more replies than jobs.
            self._awaited -= 1
            self.inbox.put(_Heard(self, took_s, reply))

    def end(self) -> None:
        """End the query; called exactly once, with replies or without."""
        if self._awaited:
            self.inbox.put(_Heard(self, time.monotonic() - self.asked_s))

    def _pass_on(self, kind: FaultKind) -> None:
        """Report a reply that does not count, once for each query."""
        if not self._has_stray:
            self._has_stray = True
            numbers = ", ".join(map(str, self.open.values()))
            about = f"job {numbers}" if numbers else "properties"
            self.inbox.put((kind, self.member.name, about))


@dataclass(frozen=True, slots=True)
class _Heard:
    """A reply to a query after some time [s], or its end."""

    asked: _Asked
    took_s: float
    reply: zenoh.Reply | None = None

    @property
    def is_expired(self) -> bool:
        """Whether the query ended because its time was over."""
        # The hub measures the time by itself.
        return self.reply is None and self.took_s >= _NEARLY * self.asked.wait_s


@dataclass(slots=True)
class _Unsent:
    """Jobs that will travel to an agent together; ``wait_s``: the longest wait [s]."""

    numbers: list[int] = field(default_factory=list)
    payloads: list[bytes] = field(default_factory=list)
    wait_s: float = 0.0


@dataclass(frozen=True, slots=True)
class _Queried:
    """A query to one of the coordinator's own keys."""

    query: zenoh.Query
    key: str


_Stray = tuple[FaultKind, str, str]
"""A reply that does not count, as ``PeerFaults.note`` takes it."""
_Told = _Heard | _Stray | _Queried | zenoh.Sample
_News = _Told | None
"""What ``receive`` waits for; None only ends its wait."""


class Network:
    """A coordinator's end of the network; use it in a ``with``.

    Attributes:
        address: where agents connect to.
        own_address: where this user's processes on this machine connect to.
        faults: counts of what agents sent and nothing used.
        queries: of operators and viewers; ``receive`` takes them.
    """

    def __init__(
        self,
        *,
        name: str,
        fleet: str = DEFAULT_FLEET,
        listen: tuple[str, ...] = (),
        connect: str = "",
        tls: Tls | None = None,
        certificates: Iterable[Certificate] | None = None,
        give_up_after_s: float = math.inf,
        stop: threading.Event | None = None,
    ) -> None:
        """Configure the session; ``with`` opens it.

        The hub within this process listens on the addresses, beside a Unix socket that
        only this user can connect to. Or a hub is elsewhere, at ``connect``, and
        nothing listens here; without it for ``give_up_after_s``, ``receive`` raises.
        ``with`` waits for it as long, if that is finite, or until ``stop``. No other
        process ever has the name. The certificates are those that may connect; None:
        all of the authority.

        Raises:
            NetworkError: invalid names or addresses, or an address that other machines
                reach without TLS.
        """
        self.own_address = connect or new_socket()
        self.address = connect or (*listen, self.own_address)[0]
        self.faults = PeerFaults()
        self._me = FleetMember(
            check_name(fleet, "fleet"), "coordinator", check_name(name, "name")
        )
        self._config = (
            client_config(connect, tls)
            if connect
            else hub_config((*listen, self.own_address), tls, certificates)
        )
        self._is_hub = not connect
        self._hub = HubWatch(
            self.address, tell_user, warn_user, give_up_after_s, tls=tls, fleet=fleet
        )
        self._stop = stop or threading.Event()
        self._look_s = 0.0
        self._inbox: Inbox[_News] = Inbox()
        self._membership = Membership(wire_version(), self.faults)
        self._info_queue = InfoQueue()
        self._asked_infos: set[FleetMember] = set()
        self.queries = Queries(self._me.state, self.faults)
        self._outlet = Outlet()
        self._unsent: dict[str, _Unsent] = {}

    @property
    def refused(self) -> Mapping[str, str]:
        """Agents that may not take part, and why."""
        return self._membership.refused

    def __enter__(self) -> Self:
        """Open the session and start to look for agents.

        Raises:
            NetworkError: an address in use, or no hub.
            KeyboardInterrupt: stopped while there was no hub.
        """
        with ExitStack() as opened:
            self._session = opened.enter_context(self._open())
            self._declare()
            if self._is_hub:
                opened.enter_context(watch_unlisted(self._session, self._config))
            self._opened = opened.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    def _open(self) -> zenoh.Session:
        config = session_config(self._config, self._me)
        if not self._is_hub and self._hub.give_up_after_s < math.inf:
            session = open_at_hub(config, self._hub, self._stop, is_agent=False)
            if session is None:
                raise KeyboardInterrupt
            return session
        try:
            return open_session(config)
        except zenoh.ZError as error:
            if self._is_hub:
                raise cannot_listen(self.address, str(error)) from None
            raise NetworkError(why_no_hub(self.address, self._hub.tls)) from None

    def _declare(self) -> None:
        protocol, _, port = parse_address(self.address)
        if self._is_hub and protocol == "tcp" and port == 0:
            self.address = self._free_address()
        put = zenoh.handlers.Callback(self._inbox.put, indirect=False)
        self._watches = [
            self._session.liveliness().declare_subscriber(
                key_of_all(self._me.fleet, kind, "alive"), put, history=True
            )
            for kind in _KINDS
        ]
        self._queryables = [
            self._session.declare_queryable(key, self._enqueue(key), complete=True)
            for key in (self._me.command, self._me.state)
        ]
        self._outlet.lead_to(self._session)
        self._token = self._session.liveliness().declare_token(self._me.alive)

    def migration(self) -> MigrationService:
        """Open the connection to coordinators of other groups of islands."""
        return MigrationService(self._session, self._me, self.wake)

    def _enqueue(self, key: str) -> "zenoh.handlers.Callback[zenoh.Query]":
        """Return a callback for the queries of a key; they may have wildcards."""
        return zenoh.handlers.Callback(
            lambda query: self._inbox.put(_Queried(query, key)), indirect=False
        )

    def _free_address(self) -> str:
        key = f"@/{self._session.zid()}/router"
        for reply in self._session.get(key, consolidation=_NOW):
            if reply.ok is not None:
                found = json.loads(reply.ok.payload.to_bytes())["locators"]
                return next(str(each) for each in found if each.startswith("tcp/"))
        raise NetworkError(f"the hub did not report its port on {self.address}")

    def send(self, number: int, agent: str, payload: bytes, wait_s: float, /) -> None:
        """Send a job to an agent; ``receive`` returns exactly one ``Returned`` for it.

        It travels with others to that agent at the next ``receive`` or before.
        ``agent``: that has joined; if it has left since, the job is lost. ``wait_s``:
        time without a reply after which its outcome is "expired" [s].
        """
        unsent = self._unsent.setdefault(agent, _Unsent())
        unsent.numbers.append(number)
        unsent.payloads.append(payload)
        unsent.wait_s = max(unsent.wait_s, wait_s)
        if len(unsent.numbers) == MOST_BUNDLED or len(payload) > _LARGE:
            self._dispatch(agent)

    def _dispatch(self, agent: str) -> None:
        """Send the jobs of an agent that are not sent."""
        unsent = self._unsent.pop(agent)
        member = self._membership.joined.get(agent)
        to = member or FleetMember(self._me.fleet, "worker", agent)
        jobs = dict(enumerate(unsent.numbers))
        asked = _Asked(to, jobs, self._inbox, unsent.wait_s)
        if member is None:
            asked.end()
        else:
            self._ask(asked, member.jobs, encode(unsent.payloads))

    def cancel(self, agent: str, payload: bytes) -> None:
        """Tell an agent that a job is no longer wanted; it may have started it."""
        if member := self._membership.joined.get(agent):
            self._session.put(member.cancelled, fingerprint(payload))

    def ask(self, agent: str, /) -> None:
        """Ask an agent for its progress; ``receive`` returns a report, if any."""
        if member := self._membership.joined.get(agent):
            self._ask_info(member)

    def _ask(self, asked: _Asked, key: str, payload: bytes | None) -> None:
        self._session.get(
            key,
            zenoh.handlers.Callback(asked.take, asked.end, indirect=False),
            payload=payload,
            # Agents share their time between coordinators.
            attachment=self._me.name,
            timeout=asked.wait_s,
            target=zenoh.QueryTarget.ALL,
            consolidation=_NOW,
        )

    def receive(self, timeout_s: float, pause_s: float = 0.0, /) -> list[DispatchEvent]:
        """Return events in order of arrival; empty if none came in time.

        Events collect during the pause [s]; after it, the first is waited for [s].

        Raises:
            HubLost: no hub has answered for too long.
        """
        for agent in [*self._unsent]:
            self._dispatch(agent)
        now_s = time.monotonic()
        if not self._is_hub and now_s >= self._look_s:
            self._look_s = now_s + _LOOK_S
            self._hub.look(self._session, self._me)
        while (began_s := time.monotonic()) >= self._info_queue.due_s:
            self._ask_info(self._info_queue.take())
            self._info_queue.spent(began_s, time.monotonic())
        events: list[DispatchEvent] = []
        time.sleep(pause_s)
        try:
            # Limited: the runs must act even if messages never stop coming.
            for turn in range(_MOST_NEWS):
                news = self._inbox.get_nowait() if turn else self._inbox.get(timeout_s)
                events += [] if news is None else self._understand(news)
                if len(events) >= _MOST_EVENTS:
                    break
        except Empty:
            pass
        return events

    @property
    def has_viewers(self) -> bool:
        """A viewer subscribes to the news."""
        return self._outlet.has_listeners(self._me.events)

    def tell(self, data: bytes) -> None:
        """Publish news, best effort."""
        self._outlet.put(self._me.events, data)

    def wake(self) -> None:
        """End the wait of ``receive``, now or next time; from any thread."""
        self._inbox.put(None)

    def _understand(self, news: _Told) -> Sequence[DispatchEvent]:
        """Return the dispatch events of a message, if any."""
        if isinstance(news, _Queried):
            self.queries.add(news.query, news.key)
            return []
        if isinstance(news, tuple):
            self.faults.note(*news)
            return []
        try:
            if isinstance(news, zenoh.Sample):
                return self._token_changed(news)
            if news.asked.is_info:
                return self._introduced(news.asked.member, news.reply)
            return self._returned(news)
        except MalformedMessage as error:
            peer = news.asked.member.name if isinstance(news, _Heard) else "a token"
            self.faults.note("malformed", peer, str(error))
            return []

    def _token_changed(self, sample: zenoh.Sample) -> list[DispatchEvent]:
        key = str(sample.key_expr)
        if sample.kind != zenoh.SampleKind.PUT:
            left = self._membership.vanish(key)
            return [left] if left else []
        if member := self._membership.appear(key):
            self._info_queue.add(member)
        return []

    def _ask_info(self, member: FleetMember) -> None:
        """Ask an agent for its properties, later if too many are asked."""
        if member in self._asked_infos or member not in self._membership:
            return
        if len(self._asked_infos) >= MOST_ASKED_INFOS:
            self._info_queue.add_again(member, 1, time.monotonic())
            return
        self._asked_infos.add(member)
        asked = _Asked(member, {}, self._inbox, ASK_TIMEOUT_S)
        # An agent of another version tells its user.
        self._ask(asked, member.info, wire_version().encode())

    def _introduced(
        self, member: FleetMember, reply: zenoh.Reply | None
    ) -> Sequence[DispatchEvent]:
        """Let an agent join if its properties are valid and its version is equal."""
        membership = self._membership
        self._asked_infos.discard(member)
        if reply is None or reply.ok is None:
            # It is alive but does not answer (yet).
            left = membership.note_silence(member)
            if membership.is_stranger(member):
                silences = membership.silences(member)
                self._info_queue.add_again(member, silences, time.monotonic())
            return [left] if left else []
        if not membership.is_stranger(member):
            # It has joined already: it was asked for its progress, or whether it lives.
            event = membership.progress(member, reply.ok.payload.to_bytes())
            return [event] if event else []
        try:
            events = membership.introduce(member, reply.ok.payload.to_bytes())
        except MalformedMessage:
            membership.note_silence(member)
            silences = membership.silences(member) + _MALFORMED_SILENCES
            self._info_queue.add_again(member, silences, time.monotonic())
            raise
        if member.name in self.refused:
            self.faults.note("refused", member.name, self.refused[member.name])
        return events

    def _returned(self, heard: _Heard) -> list[DispatchEvent]:
        """Return the outcomes of the jobs that a reply is about."""
        asked, reply = heard.asked, heard.reply
        agent, took_s = asked.member.name, heard.took_s
        if reply is None:
            lost = [asked.open.pop(place) for place in [*asked.open]]
            if lost and agent in self._membership.joined:
                # It may be gone although its token is not: another process can
                # declare the same one.
                self._info_queue.add(asked.member)
            if heard.is_expired:
                return [Returned(n, agent, "expired", took_s=took_s) for n in lost]
            return [Returned(number, agent, "lost") for number in lost]
        if reply.err is not None:
            told = reply.err.payload.to_bytes()[: 4 * LONGEST_REASON]
            why = told.decode("utf-8", "replace")
            replies = [Reply(place, reason=why) for place in asked.open]
        else:
            assert reply.ok is not None
            replies = _replies(reply.ok.payload.to_bytes(), asked.open)
        events: list[DispatchEvent] = []
        for each in replies:
            number = asked.open.pop(each.place, None)
            if number is None:
                self.faults.note("late", agent, f"place {each.place}")
            elif each.answer:
                ok = Returned(number, agent, "ok", each.answer, took_s=took_s)
                events.append(ok)
            else:
                outcome, text = _outcome(each.reason)
                reason = printable(text, LONGEST_REASON) or "no reason given"
                events.append(Returned(number, agent, outcome, reason=reason))
        return events


def _replies(data: bytes, places: Iterable[int]) -> list[Reply]:
    """Return what a reply says of jobs; malformed bytes are the answer to each."""
    try:
        return decode(Replies, data, BUNDLE_BYTES)
    except MalformedMessage:
        return [Reply(place, b"?") for place in places]


def _keep_thread_state() -> None:
    """Keep the Python state of the calling thread, one of Zenoh's, until it ends.

    Python otherwise maps and unmaps memory for the state at each callback, which takes
    longer than a short callback.
    """
    if not hasattr(_THREAD, "has_state"):
        _THREAD.has_state = True
        ctypes.pythonapi.PyGILState_Ensure()


def _outcome(told: str) -> tuple[Literal["fenced", "cancelled", "unfit", "error"], str]:
    """Return the outcome of a job without an answer, and the reason for it."""
    if told.startswith(FENCED):
        return "fenced", told
    if told.startswith(UNFIT):
        return "unfit", told.removeprefix(UNFIT)
    return ("cancelled" if told == CANCELLED else "error"), told
