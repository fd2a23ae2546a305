"""A hub without a coordinator: routes the messages of a fleet."""

import json
import threading

import zenoh

from schema.agent.log import tell_user, warn_user
from schema.agent.network import cannot_listen
from schema.agent.service import open_session
from schema.limits import printable


def serve_hub(config: str, addresses: tuple[str, ...], stop: threading.Event) -> None:
    """Route messages until stopped.

    Args:
        config: the hub's configuration (JSON5).
        addresses: where it listens, for messages.
        stop: ends the hub.

    Raises:
        NetworkError: an address that cannot be listened on.
    """
    try:
        session = open_session(zenoh.Config.from_json5(config))
    except zenoh.ZError as error:
        raise cannot_listen(", ".join(addresses), str(error)) from None
    with session:
        for address in addresses:
            tell_user(f"listening on {address}")
        _watch = watch_unlisted(session, config)
        stop.wait()


def watch_unlisted(session: zenoh.Session, config: str) -> object:
    """Tell, while the result is kept, which certificates a hub's rules do not name."""
    subjects = json.loads(config).get("access_control", {}).get("subjects", [])
    known = {name for each in subjects for name in each.get("cert_common_names", ())}

    def note(event: zenoh.LinkEvent) -> None:
        name = event.link.auth_identifier
        if subjects and name and name not in known:
            known.add(name)
            about = "is not in --access (revoked?): what it sends is dropped"
            warn_user(f"certificate {printable(name)!r} {about}")

    return session.info.declare_link_events_listener(note, history=True)
