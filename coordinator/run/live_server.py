"""Server for viewers of a run: publishes updates, and replies with all past ones.

The run's thread encodes at a limited rate. A second thread sends the replies, which
a slow connection may block.
"""

import subprocess
import threading
from math import inf
from queue import SimpleQueue

from coordinator.arena.arena import Arena
from coordinator.dispatch.fleet import Fleet
from coordinator.network.operator_service import Order
from coordinator.network.service import Network
from coordinator.run.feed import Feed
from coordinator.run.loop import Loop
from schema.agent.import_path import environment, python_command
from schema.agent.network import Tls
from schema.plugins.permission import allowed
from schema.wire.updates import WorkerInfo, encode_update

_UPDATE_S = 0.2
"""Least time between two updates [s]."""
_WHOLE_S = 1.0
"""Least time between two encodings of all past updates [s]."""


class LiveServer:
    """Server of the viewers of one run."""

    def __init__(self, feed: Feed, loop: Loop, fleet: Fleet, network: Network) -> None:
        """Initialise, and start the thread that replies.

        Args:
            feed: of the run.
            loop: of the run.
            fleet: of connected workers.
            network: to the viewers.
        """
        self._feed = feed
        self._loop = loop
        self._fleet = fleet
        self._network = network
        self._update_s = self._whole_s = -1e9
        self._replies: SimpleQueue[tuple[list[Order], bytes] | None] = SimpleQueue()
        self._is_idle = threading.Event()
        self._is_idle.set()
        threading.Thread(target=self._reply, daemon=True).start()

    def serve(self, now_s: float) -> None:
        """Send the updates and replies that are due.

        Args:
            now_s: the time, of any clock that only goes forward [s].
        """
        # While a connection blocks, at most one encoding is in memory; the queries
        # wait in the network, which limits their number.
        may_reply = self._is_idle.is_set() or now_s == inf
        is_whole_due = may_reply and now_s - self._whole_s >= _WHOLE_S
        waiting = self._network.queries.onlookers() if is_whole_due else []
        if now_s - self._update_s < _UPDATE_S and not waiting:
            return
        self._update_s = now_s
        update = self._feed.update(self._workers())
        if update is not None and self._network.has_viewers:
            self._network.tell(encode_update(update))
        if waiting:
            self._whole_s = now_s
            self._is_idle.clear()
            self._replies.put((waiting, encode_update(self._feed.whole())))

    def close(self) -> None:
        """Send what is left, and stop."""
        self.serve(inf)
        self._replies.put(None)

    def _workers(self) -> tuple[WorkerInfo, ...]:
        dispatch, requests = self._fleet.dispatch, self._loop.shard_requests
        shards: dict[str, list[int]] = {}
        for number, island in sorted(self._loop.islands.items()):
            if isinstance(island, Arena):
                shards.setdefault(requests.holder(number), []).append(number)
        return tuple(
            WorkerInfo(name, dispatch.platform(name), tuple(shards.get(name, ())))
            for name in dispatch.names("worker")
        )

    def _reply(self) -> None:
        """Send replies until closed."""
        while (reply := self._replies.get()) is not None:
            orders, data = reply
            for order in orders:
                order.reply(data)
            self._is_idle.set()


def open_viewer(address: str, fleet: str, tls: Tls | None) -> None:
    """Start a viewer as a separate process, which outlives the run.

    Args:
        address: of the hub.
        fleet: name of the fleet.
        tls: files for a ``tls/`` address.
    """
    words = ["--connect", address, "--fleet", fleet]
    if tls is not None:
        words += ["--tls-ca", tls.ca, "--tls-certificate", tls.certificate]
        words += ["--tls-key", tls.key]
    for entry in allowed():
        words += ["--plugins", entry]
    # In its own session: a Ctrl-C that stops the run leaves the window open.
    subprocess.Popen(  # noqa: S603 - our own interpreter
        [*python_command("revolve"), "view", *words],
        env=environment(),
        start_new_session=True,
    )
