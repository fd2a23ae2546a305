"""A hub without a coordinator: routes the messages of a fleet."""

import threading

import zenoh

from schema.agent.log import tell_user
from schema.agent.network import cannot_listen
from schema.agent.service import start_engine


def serve_hub(config: str, addresses: tuple[str, ...], stop: threading.Event) -> None:
    """Route messages until stopped.

    Args:
        config: the hub's configuration (JSON5).
        addresses: where it listens, for messages.
        stop: ends the hub.

    Raises:
        NetworkError: an address that cannot be listened on.
    """
    start_engine()
    try:
        session = zenoh.open(zenoh.Config.from_json5(config))
    except zenoh.ZError as error:
        raise cannot_listen(", ".join(addresses), str(error)) from None
    with session:
        for address in addresses:
            tell_user(f"listening on {address}")
        stop.wait()
