"""Command ``revolve doctor``."""

import argparse
import os
import platform
import shutil
import stat
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path

from coordinator.doctor import machine, system
from coordinator.doctor.machine import Finding
from schema.agent.address import CONNECT_VARIABLE, can_lock, runtime_directory
from schema.agent.command import (
    NETWORK,
    access_of,
    add_shared,
    connect_of,
    host_name,
    tls_of,
)
from schema.agent.flags import Flags
from schema.agent.import_path import missing_screen
from schema.agent.machine import cpu_flags, platform_tag
from schema.agent.network import Tls
from schema.agent.service import why_no_hub
from schema.agent.supervisor import cores
from schema.errors import NetworkError
from schema.plugins.permission import GROUP

_REACH_S = 1.0
_RENDER_S = 4.5


def main(arguments: list[str]) -> int:
    """Print a line for each check, within five seconds; return 1 if one failed."""
    options = parser().parse_args(arguments[1:])
    began_s = time.monotonic()
    rendering = system.start_rendering()
    has_failed = False
    try:
        for finding in (*_machine(), *_fleet(options)):
            print(finding)
            has_failed |= finding.level == "fail"
    finally:
        left_s = max(0.1, _RENDER_S - (time.monotonic() - began_s))
        end = system.end_rendering(rendering, left_s)
    print(machine.check_pictures(*end))
    return int(has_failed)


def _machine() -> Iterator[Finding]:
    yield machine.check_versions(system.versions())
    flags = cpu_flags(Path("/proc/cpuinfo"))
    yield machine.check_cpu(platform.machine().lower(), flags, platform_tag())
    yield Finding("ok", "cores", f"{cores()} of {os.cpu_count()}")
    limit = system.group_bytes()
    yield machine.check_memory(system.available_bytes(), limit, cores())
    built_s = Path(__file__).stat().st_mtime
    yield machine.check_clock(time.time(), built_s)
    here = Path("runs" if Path("runs").is_dir() else "").absolute()
    free = shutil.disk_usage(here).free
    yield machine.check_disk(here, free, is_writable=os.access(here, os.W_OK))
    if not can_lock(here):
        advice = "do not resume a run there on another machine while it may go on"
        yield Finding("warn", "disk", f"no file locks in {here}", advice)
    try:
        yield machine.check_runtime(str(runtime_directory()), "")
    except NetworkError as error:
        yield machine.check_runtime("", str(error))
    # None is imported, not even a parent package.
    modules = [point.module for point in entry_points(group=GROUP)]
    found = {name: find_spec(name.partition(".")[0]) is not None for name in modules}
    yield machine.check_plugins(found)
    yield machine.check_viewer(
        has_package=find_spec("rerun") is not None, no_screen=missing_screen()
    )


def _fleet(options: argparse.Namespace) -> Iterator[Finding]:
    subject, name = "certificate", host_name()
    try:
        if (tls := tls_of(options)) is not None:
            from coordinator.doctor.certificate import check_certificate
            from schema.agent.certificate import examine

            facts, accepted = examine(tls), access_of(options)
            mode = stat.S_IMODE(Path(tls.key).stat().st_mode)
            yield from check_certificate(facts, mode, accepted, datetime.now(UTC))
            name = facts.name
        subject = "hub"
        yield from _hub(connect_of(options), options, tls, name)
    except NetworkError as error:
        yield Finding("fail", subject, str(error))


def _hub(
    connect: str, options: argparse.Namespace, tls: Tls | None, name: str
) -> Iterator[Finding]:
    from coordinator.doctor import hub
    from coordinator.network.client_service import probe, reach

    if why := reach(connect, _REACH_S):
        is_wanted = bool(options.connect or os.environ.get(CONNECT_VARIABLE))
        yield hub.no_hub(connect, why, is_wanted=is_wanted)
        return
    seen = probe(connect, options.fleet, tls, name)
    if seen.error:
        yield hub.refused(why_no_hub(connect, tls, f": {seen.error}"))
        return
    yield from hub.check_hub(seen, connect)


def parser(_command: str = "doctor") -> Flags:
    """Return the parser of ``revolve doctor``."""
    flags = Flags(
        prog="revolve doctor",
        description="Check this machine, its certificate and its connection to the "
        "hub.",
        examples=("revolve doctor", "revolve doctor --connect tls/hub.example:7447"),
    )
    add_shared(flags, "--connect", "--access", *NETWORK)
    return flags
