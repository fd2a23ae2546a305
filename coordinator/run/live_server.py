"""Server for viewers of a run: publishes updates, and replies with all past ones.

All past updates together, the state, travel in pages. They are encoded at a limited
rate. The hub lets replies to viewers be dropped, so that none blocks the run's thread.
"""

import subprocess
from math import inf

from coordinator.arena.arena import Arena
from coordinator.dispatch.fleet import JobRouter
from coordinator.network.operator_service import OperatorQuery
from coordinator.network.service import Network
from coordinator.run.feed import Feed
from coordinator.run.loop import Loop
from schema.agent.import_path import environment, python_command
from schema.agent.network import Tls
from schema.errors import MalformedMessage
from schema.plugins.permission import allowed
from schema.wire.codec import encode
from schema.wire.updates import WorkerInfo, decode_page, pages_of

_UPDATE_S = 0.2
"""Least time between two updates [s]."""
_PER_PAGE_S = 0.1
"""Least time between two encodings of the state, for each of its pages [s]."""
_MOST_REPLIES, _MOST_PAGES = 8, 6
"""Replies between two updates, and pages in a reply: what a connection can queue."""


class LiveServer:
    """Server of the viewers of one run."""

    def __init__(
        self, feed: Feed, loop: Loop, fleet: JobRouter, network: Network
    ) -> None:
        """Initialise the server; ``feed`` and ``loop`` are those of its run."""
        self._feed = feed
        self._loop = loop
        self._fleet = fleet
        self._network = network
        self._update_s = self._whole_s = -inf
        self._sequence, self._pages = -1, list[bytes]()

    def serve(self, now_s: float) -> None:
        """Send the updates and replies that are due."""
        if now_s - self._update_s < _UPDATE_S:
            return
        self._update_s = now_s
        update = self._feed.update(self._workers())
        if update is not None and self._network.has_viewers:
            self._network.tell(encode(update))
        # Viewers ask again for what is dropped here or on its way.
        for order in self._network.queries.onlookers()[:_MOST_REPLIES]:
            order.reply(*self._pages_for(order, now_s))

    def _pages_for(self, order: OperatorQuery, now_s: float) -> list[bytes]:
        """Return the pages that a viewer requests, or the first ones of a new state."""
        try:
            wanted = decode_page(order.data)
        except MalformedMessage as error:
            self._network.faults.note("malformed", "viewers", str(error))
            return []
        if wanted.page and wanted.sequence == self._sequence:
            return self._pages[wanted.page :][:_MOST_PAGES]
        if now_s >= self._whole_s:
            state = self._feed.whole()
            self._sequence, self._pages = state.sequence, pages_of(state)
            self._whole_s = now_s + _PER_PAGE_S * len(self._pages)
        return self._pages[:_MOST_PAGES]

    def close(self) -> None:
        """Send what is left."""
        self.serve(inf)

    def _workers(self) -> tuple[WorkerInfo, ...]:
        dispatch, requests = self._fleet.dispatch, self._loop.shard_requests
        shards: dict[str, list[int]] = {}
        for number, island in sorted(self._loop.islands.items()):
            if isinstance(island, Arena):
                for holder in requests.holders(number):
                    shards.setdefault(holder, []).append(number)
        return tuple(
            WorkerInfo(name, dispatch.platform(name), tuple(shards.get(name, ())))
            for name in dispatch.names("worker")
        )


def open_viewer(address: str, fleet: str, tls: Tls | None) -> None:
    """Start a viewer as a separate process, which outlives the run."""
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
