"""The coordinator's end of the network: agents, jobs, answers, operators, viewers.

The network's threads only enqueue. One thread calls ``send`` and ``receive`` and gets
events in the order of their arrival.
"""

import json
import logging
import math
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Self

import zenoh

from coordinator.dispatch.events import AgentKind, DispatchEvent, Left, Returned
from coordinator.network.membership import Membership
from schema.agent.access import Certificate
from schema.agent.address import new_socket, parse_address
from schema.agent.network import (
    ASK_TIMEOUT_S,
    DEFAULT_FLEET,
    FENCED,
    JOB_TIMEOUT_S,
    UNFIT,
    Tls,
    cannot_listen,
    client_config,
    hub_config,
)
from schema.agent.platform_tag import wire_version
from schema.agent.service import HubWatch, Outlet, tell_user
from schema.agent.topics import Member, agents_alive, check_name
from schema.errors import MalformedMessage, NetworkError

_LOG = logging.getLogger(__name__)
_KINDS: tuple[AgentKind, ...] = ("worker", "analyzer")
_NOW = zenoh.ConsolidationMode.NONE
_LONGEST_REASON = 1000
_MOST_AT_ONCE = 1000
_ASK_AGAIN_S = 1.0
_LOOK_S = 1.0
# Reply of the engine itself after a timeout.
_TIMEOUT = b"Timeout"


@dataclass(slots=True)
class _Asked:
    """A query to an agent; ``number`` is the job's, -1 asks for its ``AgentInfo``."""

    agent: str
    number: int
    inbox: "SimpleQueue[_News]"
    reply: zenoh.Reply | None = None

    def take(self, reply: zenoh.Reply) -> None:
        self.reply = reply

    def end(self) -> None:
        """End the query; called exactly once, with a reply or without."""
        self.inbox.put(self)


_News = _Asked | zenoh.Sample | zenoh.Query


@dataclass(frozen=True, slots=True)
class Order:
    """A query of an operator or a viewer; call ``reply`` once."""

    data: bytes
    query: zenoh.Query
    key: str

    def reply(self, data: bytes) -> None:
        """Reply, whether the other process still waits or not."""
        with self.query as query:
            query.reply(self.key, data)


class Network:
    """A coordinator's end of the network; use it in a ``with``.

    Attributes:
        address: where agents connect to.
        own_address: where this user's processes on this machine connect to.
        malformed: messages about agents that did not decode and were dropped; answers
            to jobs are not decoded here.
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

        Args:
            name: of this process, never used by another one.
            fleet: name of the fleet.
            listen: addresses of the hub within this process, beside a Unix socket
                that only this user can connect to.
            connect: address of a hub elsewhere; then nothing listens here.
            tls: files for ``tls/`` addresses.
            certificates: those that may connect; None: all of the authority.
            give_up_after_s: time without a hub elsewhere after which ``receive``
                raises [s].

        Raises:
            NetworkError: invalid names or addresses, or an address that other
                machines reach without TLS.
        """
        self.own_address = connect or new_socket()
        self.address = connect or (*listen, self.own_address)[0]
        self.malformed = 0
        self._me = Member(
            check_name(fleet, "fleet"), "coordinator", check_name(name, "name")
        )
        self._config = (
            client_config(connect, tls)
            if connect
            else hub_config((*listen, self.own_address), tls, certificates)
        )
        self._is_hub = not connect
        self._hub = HubWatch(self.address, tell_user, give_up_after_s)
        self._look_s = 0.0
        self._inbox: SimpleQueue[_News] = SimpleQueue()
        self._membership = Membership(wire_version())
        self._ask_again: list[tuple[float, str]] = []
        self._orders: list[Order] = []
        self._onlookers: list[Order] = []
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
        zenoh.init_log_from_env_or("error")
        with ExitStack() as opened:
            try:
                config = zenoh.Config.from_json5(self._config)
                self._session = opened.enter_context(zenoh.open(config))
            except zenoh.ZError as error:
                if not self._is_hub:
                    raise NetworkError(f"no hub at {self.address}") from None
                raise cannot_listen(self.address, str(error)) from None
            self._declare()
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
        self._operators = self._session.declare_queryable(
            self._me.command, put, complete=True
        )
        self._viewers = self._session.declare_queryable(
            self._me.state, put, complete=True
        )
        self._outlet.lead_to(self._session)
        self._token = self._session.liveliness().declare_token(self._me.alive)

    def _free_address(self) -> str:
        """Return the address with the port that the hub has chosen."""
        key = f"@/{self._session.zid()}/router"
        for reply in self._session.get(key, consolidation=_NOW):
            if reply.ok is not None:
                found = json.loads(reply.ok.payload.to_bytes())["locators"]
                return next(str(each) for each in found if each.startswith("tcp/"))
        raise NetworkError(f"the hub did not report its port on {self.address}")

    def send(self, number: int, agent: str, payload: bytes) -> None:
        """Send a job to an agent; ``receive`` returns exactly one ``Returned`` for it.

        Args:
            number: of the job.
            agent: that has joined; if it has left since, the job is lost.
            payload: an encoded request.
        """
        asked = _Asked(agent, number, self._inbox)
        if member := self._membership.members.get(agent):
            self._ask(asked, member.jobs, payload, JOB_TIMEOUT_S)
        else:
            asked.end()

    def cancel(self, agent: str, payload: bytes) -> None:
        """Tell an agent that a job is no longer wanted; it may have started it.

        Args:
            agent: that was given the job, and may have left.
            payload: an encoded request, of which only the name of the job is needed.
        """
        if member := self._membership.members.get(agent):
            self._session.put(member.cancelled, payload)

    def _ask(
        self, asked: _Asked, key: str, payload: bytes | None, timeout_s: float
    ) -> None:
        self._session.get(
            key,
            zenoh.handlers.Callback(asked.take, asked.end, indirect=False),
            payload=payload,
            # Agents share their time between coordinators.
            attachment=self._me.name,
            timeout=timeout_s,
            consolidation=_NOW,
        )

    def receive(self, timeout_s: float, pause_s: float = 0.0, /) -> list[DispatchEvent]:
        """Return events in order of arrival; empty if none came in time.

        Args:
            timeout_s: how long to wait for the first event, after the pause [s].
            pause_s: how long to let events collect first [s].

        Raises:
            NetworkError: another coordinator has taken this one's run over, or
                ``HubLost``.
        """
        now_s = time.monotonic()
        if not self._is_hub and now_s >= self._look_s:
            self._look_s = now_s + _LOOK_S
            self._hub.seen(is_there=bool(self._session.info.routers_zid()))
        while self._ask_again and self._ask_again[0][0] <= now_s:
            self._ask_info(self._ask_again.pop(0)[1])
        events: list[DispatchEvent] = []
        time.sleep(pause_s)
        try:
            news = self._inbox.get(timeout=timeout_s)
            while True:
                events += self._understand(news)
                if len(events) >= _MOST_AT_ONCE:
                    return events
                news = self._inbox.get_nowait()
        except Empty:
            return events

    def orders(self) -> list[Order]:
        """Return the operators' queries since the last call; ``receive`` takes them."""
        orders, self._orders = self._orders, []
        return orders

    def onlookers(self) -> list[Order]:
        """Return the viewers' queries for the whole run since the last call."""
        onlookers, self._onlookers = self._onlookers, []
        return onlookers

    @property
    def has_viewers(self) -> bool:
        """A viewer subscribes to the news."""
        return self._outlet.has_listeners(self._me.events)

    def tell(self, data: bytes) -> None:
        """Publish news, best effort."""
        self._outlet.put(self._me.events, data)

    def _understand(self, news: _News) -> Sequence[DispatchEvent]:
        """Return the dispatch events of a message, if any."""
        if isinstance(news, zenoh.Query):
            data = b"" if news.payload is None else news.payload.to_bytes()
            is_onlooker = str(news.key_expr) == self._me.state
            asked = self._onlookers if is_onlooker else self._orders
            key = self._me.state if is_onlooker else self._me.command
            asked.append(Order(data, news, key))
            return []
        try:
            if isinstance(news, zenoh.Sample):
                return self._token_changed(news)
            if news.number < 0:
                return self._introduced(news)
            return [self._returned(news)]
        except MalformedMessage as error:
            self.malformed += 1
            _LOG.warning("dropped a malformed message: %s", error)
            return []

    def _token_changed(self, sample: zenoh.Sample) -> list[DispatchEvent]:
        key = str(sample.key_expr)
        if sample.kind != zenoh.SampleKind.PUT:
            left = self._membership.vanish(key)
            return [left] if left else []
        if member := self._membership.appear(key):
            self._ask_info(member.name)
        return []

    def _ask_info(self, agent: str) -> None:
        if member := self._membership.members.get(agent):
            asked = _Asked(agent, -1, self._inbox)
            self._ask(asked, member.info, None, ASK_TIMEOUT_S)

    def _introduced(self, asked: _Asked) -> Sequence[DispatchEvent]:
        """Let an agent join if its properties are valid and its version is equal."""
        agent, reply = asked.agent, asked.reply
        if not self._membership.is_stranger(agent):
            return []
        if reply is None or reply.ok is None:
            # It is alive but does not answer (yet).
            self._ask_again.append((time.monotonic() + _ASK_AGAIN_S, agent))
            return []
        events = self._membership.introduce(agent, reply.ok.payload.to_bytes())
        if agent in self.refused:
            self._say_refused(agent)
        return events

    def _say_refused(self, agent: str) -> None:
        _LOG.warning("refused: %s: %s", agent, self.refused[agent])

    def _returned(self, asked: _Asked) -> Returned | Left:
        number, agent, reply = asked.number, asked.agent, asked.reply
        if reply is None:
            return Returned(number, agent, "lost")
        if reply.ok is not None:
            return Returned(number, agent, "ok", reply.ok.payload.to_bytes())
        assert reply.err is not None
        told = reply.err.payload.to_bytes()
        if told == _TIMEOUT:
            return Returned(number, agent, "lost")
        reason = told.decode("utf-8", "replace")[:_LONGEST_REASON]
        if reason.startswith(FENCED):
            raise NetworkError(f"this coordinator stops: {reason[len(FENCED) :]}")
        if reason.startswith(UNFIT):
            if left := self._membership.refuse(agent, reason[len(UNFIT) :]):
                self._say_refused(agent)
                return left
            return Returned(number, agent, "lost")
        return Returned(number, agent, "error", reason=reason or "no reason given")
