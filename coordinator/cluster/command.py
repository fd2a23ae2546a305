"""Command ``revolve cluster``: certificates and samples for the machines of a lab."""

import argparse
import shutil
from contextlib import suppress
from ipaddress import ip_address
from pathlib import Path
from typing import get_args

from coordinator.cluster.certificates import AUTHORITY_DAYS
from coordinator.cluster.kit import DAYS, PORT, ClusterKit, Kit, utc_now
from schema.agent.access import Certificate, CertificateRole, check_certificates
from schema.agent.flags import Flags, add_count

_OTHERS: tuple[tuple[str, CertificateRole], ...] = (
    ("coordinator", "coordinator"),
    ("analyzer", "analyzer"),
    ("viewer", "viewer"),
    ("operator", "operator"),
)
"""Certificates that each kit has beside those of its workers."""
RESTART = "copy members/hub/access.json to the hub, and restart it"


def main(arguments: list[str]) -> int:
    """Create or change a kit, or list its certificates; return the exit code."""
    options = parser().parse_args(arguments[1:])
    folder = Path(options.folder)
    if options.action == "init":
        _init(folder, options)
        return 0
    kit = Kit.read(folder, utc_now)
    if options.action == "list":
        _list(kit)
    elif options.action == "add":
        kit.add(options.name, options.role)
        print(f"copy {folder / 'members' / options.name} to its machine; {RESTART}")
    elif options.action == "revoke":
        kit.revoke(options.name)
        print(f"{options.name} is revoked as soon as you {RESTART}")
    else:
        valid = [one.name for one in kit.cluster.members if not one.is_revoked]
        names = [options.name] if options.name else valid
        for name in names:
            kit.renew(name)
            print(f"copy {folder / 'members' / name} to its machine")
        if "hub" in names:
            print("the hub reads its certificate when it starts: restart it")
    return 0


def _init(folder: Path, options: argparse.Namespace) -> None:
    workers = [name for name in options.workers.split(",") if name]
    names = ["hub", *(name for name, _ in _OTHERS), *workers]
    # Before the folder is made: a kit cannot be made in one that is not empty.
    check_certificates(Certificate(name, "worker") for name in names)
    kit = Kit.new(folder, ClusterKit(options.hub, options.port, options.days), utc_now)
    for name, role in _OTHERS:
        kit.add(name, role)
    for name in workers:
        kit.add(name, "worker")
    kit.write_samples(shutil.which("revolve") or "revolve")
    config = "~/.config/revolve"
    print(
        f"{folder}: {len(kit.cluster.members)} certificates, valid for {options.days} "
        f"days, and their authority; keep {folder / 'ca.key'} private\n"
        "copy members/hub to the hub's machine, each worker's folder to its own, both "
        f"as {config},\nand in each shell: . {config}/env\n"
        f"on {options.hub}:\n"
        f"  revolve hub --listen tls/0.0.0.0:{options.port} --listen hub --access "
        f"{config}/access.json\n"
        "  revolve analyzer & revolve coordinator scenario1 --connect hub\n"
        f"on {', '.join(workers) or 'the workers'}:\n"
        "  revolve worker\n"
        f"samples for systemd, SLURM, Compose and Apptainer: {folder / 'samples'}"
    )


def _list(kit: Kit) -> None:
    now = utc_now()
    print(f"hub at {kit.cluster.address}")
    width = max(len(member.name) for member in kit.cluster.members)
    for member in kit.cluster.members:
        state = f"{(member.expires - now).days} days left"
        if member.expires <= now:
            state = "expired: revolve cluster renew"
        if member.is_revoked:
            state = "revoked"
        print(
            f"{member.name:{width}}  {member.role:11}  "
            f"{member.expires:%Y-%m-%d}  {state}"
        )


_EXAMPLES: dict[str, tuple[str, ...]] = {
    "init": (
        "lab --hub hub.example --workers a,b,c",
        "lab --hub 192.0.2.7 --port 7448 --days 30",
    ),
    "add": ("lab worker-d", "lab visitor --role viewer"),
    "renew": ("lab", "lab worker-a"),
    "revoke": ("lab worker-a", "lab visitor"),
    "list": ("lab", "kits/lab"),
}


def parser(_command: str = "cluster") -> Flags:
    """Return the parser of ``revolve cluster``."""
    flags = Flags(
        prog="revolve cluster",
        description="Make certificates and samples for the machines of a lab.",
        examples=(
            "revolve cluster init lab --hub hub.example --workers a,b,c",
            "revolve cluster add lab worker-d",
            "revolve cluster list lab",
        ),
    )
    actions = flags.add_subparsers(dest="action", required=True, metavar="ACTION")

    def action(name: str, what: str) -> argparse.ArgumentParser:
        made = actions.add_parser(
            name,
            help=what,
            description=f"{what.capitalize()}.",
            examples=[f"revolve cluster {name} {words}" for words in _EXAMPLES[name]],
        )
        made.add_argument("folder", metavar="DIR", help="folder of the kit")
        return made

    init = action("init", "create a kit: authority, certificates, samples")
    init.add_argument(
        "--hub",
        type=_host,
        required=True,
        metavar="HOST",
        help="host name or address of the hub",
    )
    add_count(init, "--port", PORT, "port of the hub")
    init.add_argument(
        "--workers",
        default="",
        metavar="NAMES",
        help="a name for each worker's machine, or one for a whole batch system; "
        "separated by commas",
    )
    days = f"days until the certificates expire, at most {AUTHORITY_DAYS}"
    add_count(init, "--days", DAYS, days, most=AUTHORITY_DAYS)
    add = action("add", "issue a certificate for another machine")
    add.add_argument("name", metavar="NAME", help="name of the machine, in the fleet")
    add.add_argument(
        "--role",
        choices=get_args(CertificateRole),
        default="worker",
        help="what it may do (default: worker)",
    )
    renew = action("renew", "issue certificates again, before they expire")
    renew.add_argument(
        "name", nargs="?", metavar="NAME", help="name of the machine (default: all)"
    )
    revoke = action("revoke", "stop accepting a certificate")
    revoke.add_argument("name", metavar="NAME", help="name of the machine")
    action("list", "list the certificates, and when they expire")
    return flags


def _host(text: str) -> str:
    """Return a host name or an address, without a port."""
    with suppress(ValueError):
        return str(ip_address(text))
    if text and all(each.isalnum() or each in ".-_" for each in text):
        return text
    raise argparse.ArgumentTypeError(
        f"must be a host name or address without a port (see --port), got {text[:80]!r}"
    )
