"""Jobs that wait at an agent. Those that came together are a bundle.

A message costs its sender and the hub more than the answer to a short job. Replies to
such jobs wait for those of the others, but not for long.
"""

import threading
import time
from queue import Empty

import zenoh

from schema.agent.inbox import TURN_S, FairQueue, Inbox
from schema.agent.request_handler import ReplyCounts, Server
from schema.errors import MalformedMessage
from schema.limits import BUNDLE_BYTES, MOST_SHOWN
from schema.wire.codec import decode, encode
from schema.wire.messages import Jobs, Reply

_POLL_S = 0.2
# Queries that are taken before a job is done.
_MOST_QUERIES = 1000


class Bundle:
    """The jobs of one query.

    Attributes:
        requests: bytes of each; none if the query is malformed, which is refused.
    """

    def __init__(self, query: zenoh.Query, jobs: zenoh.KeyExpr) -> None:
        """Decode a query; ``jobs``: key of the replies."""
        self._query, self._jobs = query, jobs
        self._lock = threading.Lock()
        self._replies: list[Reply] = []
        self._kept_s = 0.0
        self.requests: list[bytes] = []
        payload = query.payload
        try:
            data = b"" if payload is None else payload.to_bytes()
            self.requests = decode(Jobs, data, BUNDLE_BYTES)
        except MalformedMessage as error:
            query.reply_err(str(error))
            self._drop_query()
        self._open = len(self.requests)

    def reply(self, reply: Reply, took_s: float) -> None:
        """Send a reply, or keep it for a moment if the job was quick [s]."""
        with self._lock:
            self._replies.append(reply)
            self._kept_s += took_s
        self._open -= 1
        if self._kept_s >= TURN_S or not self._open:
            self.send()
        if not self._open:
            self._drop_query()

    def send(self) -> None:
        """Send the replies that are kept; from any thread."""
        with self._lock:
            replies, self._replies, self._kept_s = self._replies, [], 0.0
            if replies:
                self._query.reply(self._jobs, encode(replies))

    def drop(self) -> None:
        """Drop a job: it is lost for its coordinator once the others are done."""
        self._open -= 1
        if not self._open:
            self.send()
            self._drop_query()

    def _drop_query(self) -> None:
        self._query.drop()  # type: ignore[no-untyped-call]


class WaitingJobs:
    """Jobs of all coordinators, in turns, and the replies to them."""

    def __init__(self, jobs: zenoh.KeyExpr, counts: ReplyCounts) -> None:
        """Initialise without jobs; ``jobs``: key of the replies."""
        self._jobs, self._counts = jobs, counts
        self._turns: FairQueue[tuple[Bundle, int]] = FairQueue()
        self._at_work: Bundle | None = None

    def take_all(self, inbox: Inbox[zenoh.Query]) -> bool:
        """Take all jobs that arrived; return whether any waits."""
        turns = self._turns
        try:
            # Limited: jobs are done even if queries never stop coming.
            for _ in range(_MOST_QUERIES):
                # Wait only while there is nothing to do.
                query = inbox.get_nowait() if turns else inbox.get(_POLL_S)
                sender = query.attachment
                source = sender.to_bytes()[:MOST_SHOWN] if sender else b""
                bundle = Bundle(query, self._jobs)
                if not bundle.requests:
                    self._counts.refused += 1
                    self._counts.malformed += 1
                for place, request in enumerate(bundle.requests):
                    for dropped, _ in turns.put(source, (bundle, place), len(request)):
                        self._counts.crowd += 1
                        dropped.drop()
        except Empty:
            pass
        return bool(turns)

    def do_next(self, server: Server) -> Reply:
        """Do the next job; its reply is sent, or will be soon."""
        began_s = time.monotonic()
        bundle, place = self._turns.take()
        if self._at_work is not bundle:
            self.send_replies()
            self._at_work = bundle
        reply = server.reply(bundle.requests[place], place)
        took_s = time.monotonic() - began_s
        bundle.reply(reply, took_s)
        self._turns.spent(took_s)
        return reply

    def send_replies(self) -> None:
        """Send the replies that wait for others; from any thread."""
        if self._at_work is not None:
            self._at_work.send()

    def drop_all(self) -> None:
        """Drop the jobs: those without a reply are lost for their coordinators."""
        while self._turns:
            bundle, _ = self._turns.take()
            bundle.drop()
