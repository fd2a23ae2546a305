"""Queries of operators and viewers to a coordinator, until they are answered."""

from dataclasses import dataclass

import zenoh

from coordinator.dispatch.faults import PeerFaults
from schema.limits import MOST_QUERIES, MOST_QUERY_BYTES, OPERATOR_REQUEST_BYTES


@dataclass(frozen=True, slots=True)
class OperatorQuery:
    """A query of an operator or a viewer; call ``reply`` once."""

    data: bytes
    query: zenoh.Query
    key: str

    def reply(self, *messages: bytes) -> None:
        """Reply, whether the other process still waits or not."""
        with self.query as query:
            for data in messages:
                query.reply(self.key, data)


class Queries:
    """Queries of operators and viewers that wait; their number and size are limited."""

    def __init__(self, viewers_key: str, faults: PeerFaults) -> None:
        """Initialise without queries.

        ``viewers_key``: the key that viewers query; operators query another one.
        """
        self._viewers_key = viewers_key
        self._faults = faults
        self._orders: list[OperatorQuery] = []
        self._order_bytes = 0
        self._onlookers: list[OperatorQuery] = []

    def add(self, query: zenoh.Query, key: str) -> None:
        """Keep a query until it is asked for; drop and count it beyond the limits."""
        is_onlooker = key == self._viewers_key
        asked = self._onlookers if is_onlooker else self._orders
        peers = "viewers" if is_onlooker else "operators"
        payload = query.payload
        size = 0 if payload is None else len(payload)
        if size > OPERATOR_REQUEST_BYTES:
            self._faults.note("malformed", peers, f"{size} bytes")
        elif len(asked) >= MOST_QUERIES or self._order_bytes + size > MOST_QUERY_BYTES:
            self._faults.note("crowd", peers, f"{len(asked)} queries wait")
        else:
            data = b"" if payload is None else payload.to_bytes()
            self._order_bytes += len(data)
            asked.append(OperatorQuery(data, query, key))
            return
        query.drop()  # type: ignore[no-untyped-call]

    def orders(self) -> list[OperatorQuery]:
        """Return the operators' queries since the last call."""
        orders, self._orders = self._orders, []
        self._order_bytes = 0
        return orders

    def onlookers(self) -> list[OperatorQuery]:
        """Return the viewers' queries for the state of the run since the last call."""
        onlookers, self._onlookers = self._onlookers, []
        return onlookers
