"""Receives the messages of a live run from the network.

The network's threads only queue messages. If the queue is full the oldest messages are
dropped, so that a slow viewer neither needs more memory nor blocks the run.
"""

import threading
from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Self

import zenoh

from analysis.viewer.presence import Presence
from schema.agent.log import tell_user, warn_user
from schema.agent.network import ASK_TIMEOUT_S, Tls, client_config
from schema.agent.service import HubWatch, open_session, why_no_hub
from schema.agent.topics import (
    FleetMember,
    check_name,
    key_of_all,
    member_of,
)
from schema.errors import MalformedMessage, NetworkError
from schema.limits import LIVE_BYTES, MIB, UPDATE_BYTES
from schema.wire.arena import Live
from schema.wire.codec import decode, encode
from schema.wire.updates import Page, Update, decode_page

_MOST = 2000
"""Most messages in the queue."""
_MOST_BYTES = 256 * MIB
"""Most bytes of messages in the queue."""
_MOST_TOKENS = 10_000
_MOST_COORDINATORS = 100
"""Coordinators that are asked for the complete state."""
_ASK_AGAIN_S, _NEXT_PAGES_S = 1.0, 0.25
"""Least time between two requests, and between those for parts of one state [s]."""


class Sequel:
    """Detects lost messages by their sequence numbers.

    Attributes:
        is_behind: the complete state must be requested.
        run: name of the run that is watched; empty if none is known yet.
    """

    def __init__(self) -> None:
        self.is_behind = True
        self.run = ""
        # The newest update, and the oldest one since which none was lost.
        self._last = self._since = (0, 0)

    def take(self, news: Update) -> bool:
        """Note news; return whether they are of the run that is watched."""
        place = (news.epoch, news.sequence)
        if news.is_whole:
            if self.run not in ("", news.run):
                return False
            # Updates that came while its pages travelled go on from it.
            self.is_behind = (place[0], place[1] + 1) < self._since
            self.run, self._last = news.run, max(self._last, place)
            return True
        if news.run != self.run:
            return False
        if place > self._last:
            if place != (self._last[0], self._last[1] + 1):
                self.is_behind, self._since = True, place
            self._last = place
        return True


@dataclass(frozen=True, slots=True)
class Ended:
    """Event: the coordinator of the run has left the network."""


LiveMessage = Update | Live | Ended


@dataclass(frozen=True, slots=True)
class _Message:
    """Bytes that arrived; ``asked`` is the key of the token of who sent them."""

    key: str
    data: bytes
    asked: str = ""


class LiveSource:
    """A viewer's connection to the network; a context manager.

    Attributes:
        dropped: number of messages that were malformed, of another process than the
            coordinator, or too many.
    """

    def __init__(self, connect: str, fleet: str, tls: Tls | None) -> None:
        """Check the address; ``__enter__`` connects.

        Raises:
            NetworkError: the name or the address is invalid.
        """
        self.dropped = 0
        self._fleet = check_name(fleet, "fleet")
        self._connect = connect
        self._config = client_config(connect, tls)
        self._waiting: deque[_Message] = deque()
        self._waiting_bytes = 0
        self._tokens: deque[zenoh.Sample] = deque(maxlen=_MOST_TOKENS)
        self._lock = threading.Lock()
        self._has_news = threading.Event()
        self._presence = Presence()
        self._hub = HubWatch(connect, tell_user, warn_user, tls=tls, fleet=fleet)
        self._has_told = False
        self._has_told_end = False
        self._sequel = Sequel()
        self._asked_s = -_ASK_AGAIN_S
        # Token of the coordinator that was asked last, and the pages that it sent.
        self._asked, self._sequence = "", 0
        self._part: list[bytes] = []

    def __enter__(self) -> Self:
        """Open the session and subscribe.

        Raises:
            NetworkError: no hub answers.
        """
        with ExitStack() as opened:
            try:
                config = zenoh.Config.from_json5(self._config)
                self._session = opened.enter_context(open_session(config))
            except zenoh.ZError:
                raise NetworkError(why_no_hub(self._connect, self._hub.tls)) from None
            put = zenoh.handlers.Callback(self._take, indirect=False)
            token = zenoh.handlers.Callback(self._take_token, indirect=False)
            tokens = key_of_all(self._fleet, "coordinator", "alive")
            self._declared = [
                self._session.declare_subscriber(
                    key_of_all(self._fleet, "worker", "arena/*/pose"), put
                ),
                self._session.declare_subscriber(
                    key_of_all(self._fleet, "coordinator", "events"), put
                ),
                self._session.liveliness().declare_subscriber(
                    tokens, token, history=True
                ),
            ]
            self._opened = opened.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    def _take(self, sample: zenoh.Sample) -> None:
        self._put(str(sample.key_expr), sample.payload)

    def _take_token(self, sample: zenoh.Sample) -> None:
        self._tokens.append(sample)
        self._has_news.set()

    def _take_reply(self, member: FleetMember, reply: zenoh.Reply) -> None:
        """Take a page of the state of a run, if its coordinator itself sent it."""
        if reply.ok is None:
            return
        replier = reply.replier_id
        if replier is not None and str(replier.zid) == member.session:
            self._put(member.state, reply.ok.payload, asked=member.alive)
        else:
            with self._lock:
                self.dropped += 1

    def _put(self, key: str, payload: zenoh.ZBytes, asked: str = "") -> None:
        with self._lock:
            if len(payload) > max(UPDATE_BYTES, LIVE_BYTES):
                self.dropped += 1
                return
            message = _Message(key, payload.to_bytes(), asked)
            self._waiting.append(message)
            self._waiting_bytes += len(message.data)
            while len(self._waiting) > _MOST or self._waiting_bytes > _MOST_BYTES:
                self._waiting_bytes -= len(self._waiting.popleft().data)
                self.dropped += 1
        self._has_news.set()

    def _next(self) -> _Message | None:
        with self._lock:
            if not self._waiting:
                return None
            message = self._waiting.popleft()
            self._waiting_bytes -= len(message.data)
            return message

    def receive(self, timeout_s: float, now_s: float) -> list[LiveMessage]:
        """Return the messages received, in order; request lost ones again.

        Say when the hub is gone and when it is back.
        """
        self._has_news.wait(timeout_s)
        self._has_news.clear()
        messages: list[LiveMessage] = []
        # Limited: the viewer must go on even if messages never stop coming.
        for _ in range(_MOST):
            waiting = self._next()
            if waiting is None:
                break
            with self._dropping():
                if (message := self._understood(waiting)) is not None:
                    messages.append(message)
        while self._tokens:
            with self._dropping():
                self._token(self._tokens.popleft())
        self._look(now_s)
        if self._presence.has_ended and not self._has_told_end:
            self._has_told_end = True
            messages.append(Ended())
        wait_s = _NEXT_PAGES_S if self._part else _ASK_AGAIN_S
        if self._sequel.is_behind and now_s - self._asked_s >= wait_s:
            self._asked_s = now_s
            self._ask()
        return messages

    def forget(self) -> None:
        """Wait for another run than the one that was received first."""
        self._sequel = Sequel()

    @contextmanager
    def _dropping(self) -> Iterator[None]:
        """Count a malformed message; say what is wrong with the first."""
        try:
            yield
        except MalformedMessage as error:
            with self._lock:
                self.dropped += 1
            if not self._has_told:
                self._has_told = True
                line = f"dropped a malformed message: {error}; more are only counted"
                tell_user(line)

    def _look(self, now_s: float) -> None:
        """Note whether the hub is there; after its return the state is requested."""
        was_there = self._presence.is_hub_there
        hubs = frozenset(map(str, self._session.info.routers_zid()))
        self._presence.look(hubs, now_s)
        if not self._presence.has_ended:
            self._hub.seen(hubs)
        self._sequel.is_behind = self._sequel.is_behind or bool(hubs and not was_there)

    def _understood(self, message: _Message) -> LiveMessage | None:
        if not message.key.endswith(("/events", "/state")):
            return decode(Live, message.data, LIVE_BYTES)
        data = self._joined(message) if message.asked else message.data
        if data is None:
            return None
        news = decode(Update, data, UPDATE_BYTES)
        if news.is_whole and not message.asked:
            raise MalformedMessage("update: a complete state that was not requested")
        if not self._sequel.take(news):
            return None
        if news.is_whole:
            self._presence.watch(message.asked)
        return news

    def _joined(self, message: _Message) -> bytes | None:
        """Add a page to the part of a state; return the state once it is complete."""
        page = decode_page(message.data)
        self._sequel.run = self._sequel.run or page.run
        if message.asked != self._asked or page.run != self._sequel.run:
            return None
        if not page.page:
            self._sequence, self._part = page.sequence, []
        if (page.sequence, page.page) != (self._sequence, len(self._part)):
            return None
        self._part.append(page.data)
        if len(self._part) < page.pages:
            return None
        part, self._part = self._part, []
        return b"".join(part)

    def _token(self, sample: zenoh.Sample) -> None:
        key, coordinators = str(sample.key_expr), self._presence.coordinators
        if sample.kind != zenoh.SampleKind.PUT:
            coordinators.pop(key, None)
            return
        member = member_of(key)
        if len(coordinators) >= _MOST_COORDINATORS:
            raise MalformedMessage(f"more than {_MOST_COORDINATORS} coordinators")
        coordinators[key] = member
        self._asked_s = -_ASK_AGAIN_S
        self._sequel.is_behind = True

    def _ask(self) -> None:
        """Request the next pages of the state, without waiting.

        Coordinators are asked in turn: one without a run to show sends nothing.
        """
        there = self._presence.coordinators
        if not (self._part and self._asked in there):
            self._asked, self._part = next(iter(there), ""), []
        if (member := there.pop(self._asked, None)) is None:
            return
        there[self._asked] = member
        wanted = Page(b"", sequence=self._sequence, page=len(self._part))
        self._session.get(
            member.state,
            zenoh.handlers.Callback(partial(self._take_reply, member), indirect=False),
            payload=encode(wanted),
            timeout=ASK_TIMEOUT_S,
            # No other process can keep the request from the coordinator.
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
        )
