"""Command ``revolve hub``: the hub of a fleet as a process of its own.

Coordinators connect to it like workers, and may come and go.
"""

from coordinator.network.hub_service import serve_hub
from schema.agent.address import FORMS, HUB, parse_address
from schema.agent.command import NETWORK, access_of, add_shared, listen_of, tls_of
from schema.agent.flags import Flags
from schema.agent.log import start_log, warn_user
from schema.agent.network import hub_config
from schema.agent.supervisor import stop_on_signals


def main(arguments: list[str]) -> int:
    """Route messages until Ctrl-C; return the exit code."""
    options = parser().parse_args(arguments[1:])
    start_log("hub", as_json=options.log_json)
    tls, certificates = tls_of(options), access_of(options)
    addresses = listen_of(options.listen or [HUB], tls)
    config = hub_config(addresses, tls, certificates)
    if options.print_config:
        print(config)
        return 0
    has_tls = any(parse_address(each).protocol == "tls" for each in addresses)
    if has_tls and certificates is None:
        warn_user("without --access any certificate of the authority may do anything")
    serve_hub(config, addresses, stop_on_signals())
    return 0


def parser(_command: str = "hub") -> Flags:
    """Return the parser of ``revolve hub``."""
    flags = Flags(
        prog="revolve hub",
        description="Connect coordinators, agents and viewers until Ctrl-C.",
        examples=(
            "revolve hub    # for the processes of this user on this machine",
            "revolve hub --listen tcp/127.0.0.1:7447",
            "revolve hub --listen tls/0.0.0.0:7447 --access access.json",
        ),
    )
    flags.add_argument(
        "--listen",
        action="append",
        metavar="ADDRESS",
        help=f"address to listen on, {FORMS}; may be repeated (default: this user's "
        "hub)",
    )
    add_shared(flags, "--access", *NETWORK, "--log-json")
    flags.add_argument(
        "--print-config",
        action="store_true",
        help="print the hub's configuration for zenohd, and exit",
    )
    return flags
