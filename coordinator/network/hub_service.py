"""A hub without a coordinator: routes the messages of a fleet."""

import json
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

import zenoh

from schema.agent.log import tell_user, warn_user
from schema.agent.network import cannot_listen
from schema.agent.service import open_session
from schema.limits import printable


def serve_hub(config: str, addresses: tuple[str, ...], stop: threading.Event) -> None:
    """Route messages until stopped; errors as of ``open_hub``."""
    with open_hub(config, addresses):
        for address in addresses:
            tell_user(f"listening on {address}")
        stop.wait()


@contextmanager
def open_hub(config: str, addresses: tuple[str, ...]) -> Iterator[None]:
    """Route messages in a context.

    Raises:
        NetworkError: an address that cannot be listened on.
    """
    try:
        session = open_session(zenoh.Config.from_json5(config))
    except zenoh.ZError as error:
        raise cannot_listen(", ".join(addresses), str(error)) from None
    with session, watch_unlisted(session, config):
        yield


def watch_unlisted(
    session: zenoh.Session, config: str
) -> AbstractContextManager[object]:
    """Tell in a context which certificates connect that a hub's rules do not name.

    The context must end before the session is closed: an event that comes later, while
    the interpreter ends, would abort the process.
    """
    subjects = json.loads(config).get("access_control", {}).get("subjects", [])
    if not subjects:
        return nullcontext()
    known = {name for each in subjects for name in each.get("cert_common_names", ())}

    def note(event: zenoh.LinkEvent) -> None:
        name = event.link.auth_identifier
        if name and name not in known:
            known.add(name)
            about = "is not in --access (revoked?): what it sends is dropped"
            warn_user(f"certificate {printable(name)!r} {about}")

    listener = zenoh.handlers.Callback(note, indirect=False)
    return session.info.declare_link_events_listener(listener, history=True)
