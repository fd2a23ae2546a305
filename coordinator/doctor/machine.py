"""Checks of this machine: each takes what was read from it and returns a finding."""

from collections.abc import Collection, Mapping
from pathlib import Path
from time import gmtime, strftime

from coordinator.doctor.finding import Finding
from schema.agent.extras import install_advice
from schema.agent.platform_tag import cpu_class

GIB = 1 << 30
MIB = 1 << 20
_WORKER_BYTES = 300 * MIB
"""Memory that a worker needs; an arena of many robots needs more."""
_LEAST_DISK, _LITTLE_DISK = 100 * MIB, 2 * GIB
_BEST_CLASS = ("x86_64_v3", "x86_64_v4")


def check_versions(versions: Mapping[str, str | None]) -> Finding:
    """Check that all packages are installed.

    Args:
        versions: by name of package; None: it is not installed.
    """
    text = ", ".join(f"{name} {version or '-'}" for name, version in versions.items())
    missing = [name for name, version in versions.items() if version is None]
    if missing:
        advice = f"install them: {install_advice('')}"
        return Finding(
            "fail", "versions", f"{text}: {', '.join(missing)} missing", advice
        )
    return Finding("ok", "versions", text)


def check_cpu(machine: str, flags: Collection[str], tag: str) -> Finding:
    """Check the CPU class, which decides whose results are equal.

    Args:
        machine: architecture, as ``platform.machine`` names it, lower case.
        flags: features of the CPU; empty if the system does not list them.
        tag: platform tag of this machine.
    """
    if not flags:
        return Finding(
            "warn",
            "cpu",
            f"{tag}; the system does not list its features",
            "an arena may continue on a machine with the same tag and round "
            "differently: use machines of one kind",
        )
    found = cpu_class(machine, flags)
    if found.startswith("x86_64") and found not in _BEST_CLASS:
        return Finding(
            "warn",
            "cpu",
            f"{tag}; no AVX2",
            "simulation is slower, and arenas do not move to machines that have it",
        )
    return Finding("ok", "cpu", tag)


def check_memory(available: int | None, limit: int | None, cores: int) -> Finding:
    """Check that there is memory for a worker per core.

    Args:
        available: memory that programs can get [bytes]; None: unknown.
        limit: what a control group leaves [bytes]; None: no limit.
        cores: that this process may use.
    """
    known = [each for each in (available, limit) if each is not None]
    if not known:
        return Finding("ok", "memory", "unknown on this system")
    free = min(known)
    text = f"{free / GIB:.1f} GiB free" + " in this control group" * (free == limit)
    needed = cores * _WORKER_BYTES
    if free < _WORKER_BYTES:
        return Finding("fail", "memory", text, "one worker needs about 300 MiB")
    if free < needed:
        advice = f"--workers {free // _WORKER_BYTES}: a worker needs about 300 MiB"
        return Finding("warn", "memory", text, advice)
    return Finding("ok", "memory", text)


def check_clock(now_s: float, built_s: float) -> Finding:
    """Check that the clock does not lie before this package was made.

    Args:
        now_s: Unix time [s].
        built_s: Unix time of the package's files [s].
    """
    text = strftime("%Y-%m-%d %H:%M:%S UTC", gmtime(now_s))
    if now_s < built_s:
        built = strftime("%Y-%m-%d", gmtime(built_s))
        return Finding(
            "fail",
            "clock",
            f"{text}, before this package was installed ({built})",
            "set the clock, for example with NTP: certificates depend on it",
        )
    return Finding("ok", "clock", text)


def check_viewer(*, has_package: bool, display: str) -> Finding:
    """Check that the viewer can show a run.

    Args:
        has_package: the viewer's package is installed.
        display: name of the screen, empty without one.
    """
    if not has_package:
        return Finding("warn", "viewer", "not installed", install_advice("view"))
    if not display:
        advice = "use revolve view --serve here, and rerun --connect where one is"
        return Finding("warn", "viewer", "installed, but there is no display", advice)
    return Finding("ok", "viewer", f"installed, display {display}")


def check_pictures(code: int | None, output: str) -> Finding:
    """Check that robots can be rendered.

    Args:
        code: exit code of a process that tried to; None: it did not end in time.
        output: its last line.
    """
    if code == 0:
        return Finding("ok", "pictures", f"drawn with {output or 'OpenGL'}")
    if code is None:
        return Finding(
            "warn", "pictures", "not rendered in time", "repeat when idle, or see below"
        )
    why = output or (f"ended by signal {-code}" if code < 0 else f"exit code {code}")
    return Finding(
        "warn",
        "pictures",
        why,
        f"runs do not need them; {install_advice('pictures')}, or set MUJOCO_GL to "
        "disable if a graphics driver is broken",
    )


def check_disk(place: Path, free: int, *, is_writable: bool) -> Finding:
    """Check the disk of run folders.

    Args:
        place: folder where runs are made.
        free: space for this user [bytes].
        is_writable: this user may make a folder there.
    """
    text = f"{free / GIB:.1f} GiB free in {place}"
    if not is_writable:
        advice = "change to another directory, or use --out"
        return Finding("warn", "disk", f"{place} cannot be written", advice)
    if free < _LEAST_DISK:
        return Finding("fail", "disk", text, "free some space, or use --out")
    if free < _LITTLE_DISK:
        advice = "a long arena writes gigabytes: free some space, or use --out"
        return Finding("warn", "disk", text, advice)
    return Finding("ok", "disk", text)


def check_runtime(place: str, error: str) -> Finding:
    """Check the directory where this user's processes meet.

    Args:
        place: the directory, if it can be used.
        error: why it cannot be used; says what to do.
    """
    if error:
        return Finding("fail", "sockets", error)
    return Finding("ok", "sockets", f"{place}, for this user only")


def check_plugins(modules: Mapping[str, bool]) -> Finding:
    """Check installed plug-ins.

    Args:
        modules: of the entry points ``revolve.plugins``, and whether each is there.
    """
    missing = [name for name, is_there in modules.items() if not is_there]
    if missing:
        return Finding(
            "fail",
            "plug-ins",
            f"no module {', '.join(missing)}",
            "install the packages again, or uninstall them",
        )
    return Finding("ok", "plug-ins", ", ".join(modules) or "none installed")
