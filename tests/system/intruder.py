"""Program: a process of a lab that uses the keys of others, until SIGTERM.

Arguments: the address of a hub; files (PEM) of authority, certificate and key, or ""
for none; and the names of the coordinator and of a worker. It tries to act as both,
gives them orders, reads what others get, and counts what it got. Writes a JSON object
at its end; without a connection, "refused" and the reason.
"""

import json
import signal
import sys
import threading
from collections import Counter

import zenoh

from schema.agent.network import Tls, client_config
from schema.agent.topics import Member
from schema.wire.codec import encode
from schema.wire.messages import Call, Request
from schema.wire.operator import GetStatus, OperatorRequest

_EPOCH = 2**31
_EACH_S = 1.0
_LATE = b"Timeout"
"""What the engine itself replies after the timeout."""


def config_of(address: str, ca: str, certificate: str, key: str) -> zenoh.Config:
    """Return a client's configuration; without a certificate it shows none."""
    if not ca:
        return zenoh.Config.from_json5(client_config(address))
    files = Tls(ca, certificate or ca, key or ca)
    config = json.loads(client_config(address, files))
    if not certificate:
        config["transport"]["link"]["tls"] = {
            "root_ca_certificate": ca, "enable_mtls": False,
        }  # fmt: skip
    return zenoh.Config.from_json5(json.dumps(config))


def intrude(
    session: zenoh.Session, ears: zenoh.Session, chief: Member, other: Member
) -> Counter[str]:
    """Use the keys of a coordinator and a worker until SIGTERM."""
    got: Counter[str] = Counter()

    def count(kind: str) -> "zenoh.handlers.Callback[zenoh.Sample]":
        return zenoh.handlers.Callback(lambda _: got.update([kind]), indirect=False)

    def replies(kind: str) -> "zenoh.handlers.Callback[zenoh.Reply]":
        def take(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                got.update([kind])
            elif reply.err is not None and reply.err.payload.to_bytes() != _LATE:
                got.update([f"error {kind}"])

        return zenoh.handlers.Callback(take, indirect=False)

    def serve(query: zenoh.Query) -> None:
        got.update(["jobs"])
        with query:
            query.reply(query.key_expr, b"forged")

    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    forged = [
        *(chief.alive, other.alive),
        *(f"revolve/default/{role}/forged.1/alive" for role in ("co", "w", "an")),
    ]
    order = encode(OperatorRequest("1", 0, GetStatus()))
    claim = encode(Request("any", _EPOCH, 1, Call(b"\xc0"), b""))
    held = [
        ears.declare_subscriber("revolve/**", count("news")),
        ears.liveliness().declare_subscriber("revolve/*/w/*/alive", count("tokens")),
        *(
            ears.declare_queryable(key, zenoh.handlers.Callback(serve))
            for key in ("revolve/*/*/*/jobs", other.jobs, chief.command, chief.state)
        ),
        *map(session.liveliness().declare_token, forged),
    ]
    print("connected", flush=True)  # noqa: T201 - the test reads it
    while not stop.wait(_EACH_S):
        session.put(other.cancelled, claim)
        session.put(chief.events, b"forged")
        session.put(other.poses(0), b"forged")
        for key, data in (
            (other.jobs, claim),
            (other.info, b""),
            (chief.command, order),
            (chief.state, b""),
        ):
            session.get(
                key,
                replies(f"reply of {key.rpartition('/')[2]}"),
                payload=data,
                timeout=1.0,
                consolidation=zenoh.ConsolidationMode.NONE,
            )
        got.update(["rounds"])
    del held
    return got


def main(arguments: list[str]) -> None:
    """Connect, and use the keys of others."""
    address, ca, certificate, key, chief, other = arguments
    zenoh.init_log_from_env_or("error")
    try:
        config = config_of(address, ca, certificate, key)
        session, ears = zenoh.open(config), zenoh.open(config)
    except zenoh.ZError as error:
        print(f"refused: {error}")  # noqa: T201 - the test reads it
        return
    with session, ears:
        got = intrude(
            session,
            ears,
            Member("default", "coordinator", chief),
            Member("default", "worker", other),
        )
    print(json.dumps(got))  # noqa: T201 - the test reads it


if __name__ == "__main__":
    main(sys.argv[1:])
