"""Serves those who watch a run: news as they come, all of it for whoever asks.

The run's thread condenses and encodes, at most so often; what may have to wait for
a slow line is sent by a thread of its own.
"""

import subprocess
import sys
import threading
from math import inf
from queue import SimpleQueue

from coordinator.arena.arena import Arena
from coordinator.dispatch.fleet import Fleet
from coordinator.network.service import Network, Order
from coordinator.run.feed import Feed
from coordinator.run.loop import Loop
from schema.agent.network import Tls
from schema.wire.news import Crewman
from schema.wire.news_codec import encode_news

_NEWS_S = 0.2
_WHOLE_S = 1.0


class LiveServer:
    """All who watch one run."""

    def __init__(self, feed: Feed, loop: Loop, fleet: Fleet, network: Network) -> None:
        """Serve nobody yet.

        Args:
            feed: hears of the run's rows.
            loop: the run.
            fleet: knows who works.
            network: where those who watch are.
        """
        self._feed = feed
        self._loop = loop
        self._fleet = fleet
        self._network = network
        self._told_s = self._whole_s = -1e9
        self._waiting: list[Order] = []
        self._replies: SimpleQueue[tuple[Order, bytes] | None] = SimpleQueue()
        threading.Thread(target=self._reply, daemon=True).start()

    def serve(self, now_s: float) -> None:
        """Tell what is due to be told.

        Args:
            now_s: the time, of any clock that only goes forward [s].
        """
        self._waiting += self._network.onlookers()
        is_whole_due = self._waiting and now_s - self._whole_s >= _WHOLE_S
        if now_s - self._told_s < _NEWS_S and not is_whole_due:
            return
        self._told_s = now_s
        news = self._feed.news(self._workers())
        if news is not None and self._network.has_viewers:
            self._network.tell(encode_news(news))
        if is_whole_due:
            self._whole_s = now_s
            data = encode_news(self._feed.whole())
            for order in self._waiting:
                self._replies.put((order, data))
            self._waiting = []

    def close(self) -> None:
        """Tell what is left to tell, and serve no more."""
        self.serve(inf)
        self._replies.put(None)

    def _workers(self) -> tuple[Crewman, ...]:
        dispatch, requests = self._fleet.dispatch, self._loop.shard_requests
        shards: dict[str, list[int]] = {}
        for number, island in sorted(self._loop.islands.items()):
            if isinstance(island, Arena):
                shards.setdefault(requests.holder(number), []).append(number)
        return tuple(
            Crewman(name, dispatch.platform(name), tuple(shards.get(name, ())))
            for name in dispatch.names("worker")
        )

    def _reply(self) -> None:
        """Reply until closed; one whose line is stuck holds up no run."""
        while (reply := self._replies.get()) is not None:
            order, data = reply
            order.reply(data)


def open_viewer(address: str, fleet: str, tls: Tls | None) -> None:
    """Start a viewer as a process of its own, which outlives the run.

    Args:
        address: of the hub.
        fleet: name of the fleet.
        tls: files for a ``tls/`` address.
    """
    words = ["--connect", address, "--fleet", fleet]
    if tls is not None:
        words += ["--tls-ca", tls.ca, "--tls-certificate", tls.certificate]
        words += ["--tls-key", tls.key]
    # Of its own session: a Ctrl-C that stops the run leaves the window open.
    subprocess.Popen(  # noqa: S603 - our own interpreter
        [sys.executable, "-m", "revolve", "view", *words], start_new_session=True
    )
