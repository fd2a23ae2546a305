"""Receives the messages of a live run from the network.

The network's threads only queue messages. If the queue is full the oldest messages are
dropped, so that a slow viewer neither needs more memory nor blocks the run.
"""

import threading
from collections import deque
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Self

import zenoh

from schema.agent.log import tell_user
from schema.agent.network import ASK_TIMEOUT_S, Tls, client_config
from schema.agent.service import log_engine
from schema.agent.topics import (
    Member,
    agents_alive,
    check_name,
    member_of,
    news_of_all,
    poses_of_all,
)
from schema.errors import MalformedMessage, NetworkError
from schema.wire.arena_codec import Live, decode_live
from schema.wire.updates import Update, decode_update

_MOST = 2000
"""Most messages in the queue."""
_ASK_AGAIN_S = 3.0


class Sequel:
    """Detects lost messages by their sequence numbers.

    Attributes:
        is_behind: the complete state must be requested.
    """

    def __init__(self) -> None:
        self.is_behind = True
        self._run = ""
        self._last = (0, 0)

    def take(self, news: Update) -> bool:
        """Note news; return whether they are of the run that is watched."""
        place = (news.epoch, news.sequence)
        if news.is_whole:
            if self._run not in ("", news.run):
                return False
            self._run, self._last, self.is_behind = news.run, place, False
            return True
        if news.run != self._run:
            return False
        if place > self._last:
            is_next = place == (self._last[0], self._last[1] + 1)
            self.is_behind = self.is_behind or not is_next
            self._last = place
        return True


@dataclass(frozen=True, slots=True)
class Ended:
    """Event: the coordinator has left the network."""


LiveMessage = Update | Live | Ended


class LiveSource:
    """A viewer's connection to the network; a context manager.

    Attributes:
        malformed: number of messages that could not be decoded and were dropped.
    """

    def __init__(self, connect: str, fleet: str, tls: Tls | None) -> None:
        """Check the address; ``__enter__`` connects.

        Args:
            connect: address of the hub.
            fleet: name of the fleet.
            tls: certificate files, for a ``tls/`` address.

        Raises:
            NetworkError: the name or the address is invalid.
        """
        self.malformed = 0
        self._fleet = check_name(fleet, "fleet")
        self._connect = connect
        self._config = client_config(connect, tls)
        self._waiting: deque[zenoh.Sample | zenoh.Reply] = deque(maxlen=_MOST)
        self._has_news = threading.Event()
        self._coordinators: dict[str, Member] = {}
        self._sequel = Sequel()
        self._asked_s = -_ASK_AGAIN_S

    def __enter__(self) -> Self:
        """Open the session and subscribe.

        Raises:
            NetworkError: no hub answers.
        """
        log_engine()
        with ExitStack() as opened:
            try:
                config = zenoh.Config.from_json5(self._config)
                self._session = opened.enter_context(zenoh.open(config))
            except zenoh.ZError:
                raise NetworkError(f"no coordinator at {self._connect}") from None
            put = zenoh.handlers.Callback(self._put, indirect=False)
            tokens = agents_alive(self._fleet, "coordinator")
            self._declared = [
                self._session.declare_subscriber(poses_of_all(self._fleet), put),
                self._session.declare_subscriber(news_of_all(self._fleet), put),
                self._session.liveliness().declare_subscriber(
                    tokens, put, history=True
                ),
            ]
            self._opened = opened.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    def _put(self, message: zenoh.Sample | zenoh.Reply) -> None:
        self._waiting.append(message)
        self._has_news.set()

    def receive(self, timeout_s: float, now_s: float) -> list[LiveMessage]:
        """Return the messages received, in order; request lost ones again.

        Args:
            timeout_s: time to wait for a message [s].
            now_s: time of a monotonic clock [s].
        """
        self._has_news.wait(timeout_s)
        self._has_news.clear()
        messages: list[LiveMessage] = []
        while self._waiting:
            try:
                each = self._understood(self._waiting.popleft())
            except MalformedMessage as error:
                self.malformed += 1
                if self.malformed == 1:
                    tell_user(f"dropped a malformed message: {error}")
                continue
            if each is not None:
                messages.append(each)
        if self._sequel.is_behind and now_s - self._asked_s >= _ASK_AGAIN_S:
            self._asked_s = now_s
            self._ask()
        return messages

    def _understood(self, message: zenoh.Sample | zenoh.Reply) -> LiveMessage | None:
        if isinstance(message, zenoh.Reply):
            if message.ok is None:
                return None
            return self._news(message.ok.payload.to_bytes())
        key = str(message.key_expr)
        if key.endswith("/alive"):
            return self._token(key, message.kind == zenoh.SampleKind.PUT)
        data = message.payload.to_bytes()
        return self._news(data) if key.endswith("/events") else decode_live(data)

    def _news(self, data: bytes) -> Update | None:
        news = decode_update(data)
        return news if self._sequel.take(news) else None

    def _token(self, key: str, is_there: bool) -> Ended | None:  # noqa: FBT001 - a word
        if is_there:
            self._coordinators[key] = member_of(key)
            self._asked_s = -_ASK_AGAIN_S
            self._sequel.is_behind = True
            return None
        self._coordinators.pop(key, None)
        return None if self._coordinators else Ended()

    def _ask(self) -> None:
        """Request the complete state from all coordinators, without waiting."""
        for member in self._coordinators.values():
            self._session.get(
                member.state,
                zenoh.handlers.Callback(self._put, indirect=False),
                timeout=ASK_TIMEOUT_S,
                consolidation=zenoh.ConsolidationMode.NONE,
            )
