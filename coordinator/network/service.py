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
    open_session,
    session_config,
    why_no_hub,
)
from schema.agent.topics import Member, agents_alive, check_name
from schema.errors import MalformedMessage, NetworkError
from schema.limits import LONGEST_REASON, MOST_ASKED_INFOS, printable
from schema.wire.codec import fingerprint

_KINDS: tuple[AgentKind, ...] = ("worker", "analyzer")
_NOW = zenoh.ConsolidationMode.NONE
_MOST_EVENTS = 1000
_MOST_NEWS = 10_000
_LOOK_S = 1.0
_NEARLY = 0.99
# Properties that are malformed are hardly better after a second.
_MALFORMED_SILENCES = 5
_THREAD = threading.local()


@dataclass(slots=True)
class _Asked:
    """A query to an agent; ``number`` is the job's, -1 asks for its ``AgentInfo``.

    ``took_s`` is the time from sending it to its reply, ``wait_s`` the longest [s].

    Any process can serve the agent's key. All that do get the query, so that none can
    keep it from the agent, and only the reply of the agent's own session counts.
    """

    member: Member
    number: int
    inbox: "Inbox[_News]"
    wait_s: float
    reply: zenoh.Reply | None = None
    has_stray: bool = False
    asked_s: float = field(default_factory=time.monotonic)
    took_s: float = 0.0

    def take(self, reply: zenoh.Reply) -> None:
        """Pass the first reply on at once: another process may never end its own."""
        _keep_thread_state()
        replier = reply.replier_id
        took_s = time.monotonic() - self.asked_s
        if replier is None or (reply.ok is None and took_s >= self.wait_s):
            return  # of the engine itself or of the hub, after the wait
        if str(replier.zid) != self.member.session:
            self._pass_on("foreign")
        elif self.reply is not None:
            self._pass_on("late")
        else:
            self.reply, self.took_s = reply, took_s
            self.inbox.put(self)

    def end(self) -> None:
        """End the query; called exactly once, with a reply or without."""
        if self.reply is None:
            self.took_s = time.monotonic() - self.asked_s
            self.inbox.put(self)

    @property
    def is_expired(self) -> bool:
        """Whether it ended without a reply because its time was over."""
        # The hub measures the time by itself.
        return self.reply is None and self.took_s >= _NEARLY * self.wait_s

    def _pass_on(self, kind: FaultKind) -> None:
        """Report a reply that does not count, once for each query."""
        if not self.has_stray:
            self.has_stray = True
            about = "properties" if self.number < 0 else f"job {self.number}"
            self.inbox.put((kind, self.member.name, about))


@dataclass(frozen=True, slots=True)
class _Queried:
    """A query to one of the coordinator's own keys."""

    query: zenoh.Query
    key: str


_Stray = tuple[FaultKind, str, str]
"""A reply that does not count, as ``PeerFaults.note`` takes it."""
_Told = _Asked | _Stray | _Queried | zenoh.Sample
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
    ) -> None:
        """Configure the session; ``with`` opens it.

        The hub within this process listens on the addresses, beside a Unix socket that
        only this user can connect to. Or a hub is elsewhere, at ``connect``, and
        nothing listens here; without it for ``give_up_after_s``, ``receive`` raises. No
        other process ever has the name. The certificates are those that may connect;
        None: all of the authority.

        Raises:
            NetworkError: invalid names or addresses, or an address that other machines
                reach without TLS.
        """
        self.own_address = connect or new_socket()
        self.address = connect or (*listen, self.own_address)[0]
        self.faults = PeerFaults()
        self._me = Member(
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
        self._look_s = 0.0
        self._inbox: Inbox[_News] = Inbox()
        self._membership = Membership(wire_version(), self.faults)
        self._info_queue = InfoQueue()
        self._asked_infos: set[Member] = set()
        self.queries = Queries(self._me.state, self.faults)
        self._outlet = Outlet()

    @property
    def refused(self) -> Mapping[str, str]:
        """Agents that may not take part, and why."""
        return self._membership.refused

    def __enter__(self) -> Self:
        """Open the session and start to look for agents.

        Raises:
            NetworkError: an address in use, or no hub.
        """
        with ExitStack() as opened:
            try:
                config = session_config(self._config, self._me)
                self._session = opened.enter_context(open_session(config))
            except zenoh.ZError as error:
                if self._is_hub:
                    raise cannot_listen(self.address, str(error)) from None
                line = why_no_hub(self.address, self._hub.tls)
                raise NetworkError(line) from None
            self._declare()
            if self._is_hub:
                opened.enter_context(watch_unlisted(self._session, self._config))
            self._opened = opened.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    def _declare(self) -> None:
        protocol, _, port = parse_address(self.address)
        if self._is_hub and protocol == "tcp" and port == 0:
            self.address = self._free_address()
        put = zenoh.handlers.Callback(self._inbox.put, indirect=False)
        self._watches = [
            self._session.liveliness().declare_subscriber(
                agents_alive(self._me.fleet, kind), put, history=True
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
        """Return the address with the port that the hub has chosen."""
        key = f"@/{self._session.zid()}/router"
        for reply in self._session.get(key, consolidation=_NOW):
            if reply.ok is not None:
                found = json.loads(reply.ok.payload.to_bytes())["locators"]
                return next(str(each) for each in found if each.startswith("tcp/"))
        raise NetworkError(f"the hub did not report its port on {self.address}")

    def send(self, number: int, agent: str, payload: bytes, wait_s: float, /) -> None:
        """Send a job to an agent; ``receive`` returns exactly one ``Returned`` for it.

        ``agent``: that has joined; if it has left since, the job is lost. ``wait_s``:
        time without a reply after which its outcome is "expired" [s].
        """
        if member := self._membership.joined.get(agent):
            asked = _Asked(member, number, self._inbox, wait_s)
            self._ask(asked, member.jobs, payload)
        else:
            gone = Member(self._me.fleet, "worker", agent)
            _Asked(gone, number, self._inbox, wait_s).end()

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
            if news.number < 0:
                return self._introduced(news)
            return self._returned(news)
        except MalformedMessage as error:
            peer = news.member.name if isinstance(news, _Asked) else "a token"
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

    def _ask_info(self, member: Member) -> None:
        """Ask an agent for its properties, later if too many are asked."""
        if member in self._asked_infos or member not in self._membership:
            return
        if len(self._asked_infos) >= MOST_ASKED_INFOS:
            self._info_queue.add_again(member, 1, time.monotonic())
            return
        self._asked_infos.add(member)
        asked = _Asked(member, -1, self._inbox, ASK_TIMEOUT_S)
        # An agent of another version tells its user.
        self._ask(asked, member.info, wire_version().encode())

    def _introduced(self, asked: _Asked) -> Sequence[DispatchEvent]:
        """Let an agent join if its properties are valid and its version is equal."""
        member, reply, membership = asked.member, asked.reply, self._membership
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

    def _returned(self, asked: _Asked) -> list[DispatchEvent]:
        number, agent, reply = asked.number, asked.member.name, asked.reply
        if reply is None:
            if agent in self._membership.joined:
                # It may be gone although its token is not: another process can
                # declare the same one.
                self._info_queue.add(asked.member)
            if asked.is_expired:
                return [Returned(number, agent, "expired", took_s=asked.took_s)]
            return [Returned(number, agent, "lost")]
        if reply.ok is not None:
            answer = reply.ok.payload.to_bytes()
            return [Returned(number, agent, "ok", answer, took_s=asked.took_s)]
        assert reply.err is not None
        told = reply.err.payload.to_bytes()[: 4 * LONGEST_REASON].decode(
            "utf-8", "replace"
        )
        outcome, text = _outcome(told)
        reason = printable(text, LONGEST_REASON) or "no reason given"
        return [Returned(number, agent, outcome, reason=reason)]


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
