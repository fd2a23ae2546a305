"""What an agent does at its end."""

import threading

import zenoh

from schema.agent.address import new_socket
from schema.agent.network import Agent, hub_config
from schema.agent.request_handler import ReplyCounts
from schema.agent.service import Outlet, serve


class NotedOutlet(Outlet):
    """Outlet that notes when the agent's session opens and is about to close."""

    def __init__(self, steps: list[str], stop: threading.Event) -> None:
        super().__init__()
        self._steps, self._stop = steps, stop

    def lead_to(self, session: zenoh.Session | None) -> None:
        super().lead_to(session)
        self._steps.append("closing" if session is None else "open")
        self._stop.set()


def test_totals_are_told_before_the_session_closes() -> None:
    steps: list[str] = []
    stop = threading.Event()

    def totals(counts: ReplyCounts) -> None:
        steps.append(f"{counts.refused} refused")

    address = new_socket()
    with zenoh.open(zenoh.Config.from_json5(hub_config((address,)))):
        serve(
            lambda request: request,
            Agent("worker", "w", address),
            stop,
            outlet=NotedOutlet(steps, stop),
            totals=totals,
        )
    assert steps == ["open", "0 refused", "closing"]
