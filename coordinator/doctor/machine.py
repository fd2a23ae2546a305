"""Checks of this machine: each takes what was read from it and returns a finding.

A size is in bytes, a time in seconds of Unix time.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import gmtime, strftime
from typing import Literal

from schema.agent.extras import install_advice
from schema.agent.machine import cpu_class

Level = Literal["ok", "warn", "fail"]


@dataclass(frozen=True, slots=True)
class Finding:
    """What a check found.

    Attributes:
        level: "ok"; "warn": something works worse or not at all that a run does not
            need; "fail": runs do not work.
        advice: what to do; empty if nothing is.
    """

    level: Level
    subject: str
    text: str
    advice: str = ""

    def __str__(self) -> str:
        """Return the finding as one line."""
        line = f"{self.level:4}  {self.subject:12}  {self.text}"
        return f"{line}; {self.advice}" if self.advice else line


Case = tuple[bool, Level, str, str]
"""Whether a case holds; level, text and advice of its finding."""


def judged(subject: str, text: str, *cases: Case) -> Finding:
    """Return the finding of the first case that holds, else "ok" with the text."""
    for holds, level, what, advice in cases:
        if holds:
            return Finding(level, subject, what, advice)
    return Finding("ok", subject, text)


GIB = 1 << 30
MIB = 1 << 20
_WORKER_BYTES = 300 * MIB
"""Memory that a worker needs; an arena of many robots needs more."""
_WORKER_NEEDS = "worker needs about 300 MiB"
_LEAST_DISK, _LITTLE_DISK = 100 * MIB, 2 * GIB
_BEST_CLASS = ("x86_64_v3", "x86_64_v4")
_SPACE = "free some space, or use --out"


def check_versions(versions: Mapping[str, str | None]) -> Finding:
    """Check that all packages are installed; the version of others is None."""
    text = ", ".join(f"{name} {version or '-'}" for name, version in versions.items())
    missing = [name for name, version in versions.items() if version is None]
    why, advice = f"{text}: {', '.join(missing)} missing", install_advice("")
    install = f"install them: {advice}"
    return judged("versions", text, (bool(missing), "fail", why, install))


def check_cpu(machine: str, flags: Collection[str], tag: str) -> Finding:
    """Check the CPU class, which decides whose results are equal.

    ``flags`` are empty if the system does not list the features of the CPU.
    """
    level = cpu_class(machine, flags)
    is_old = level.startswith("x86_64") and level not in _BEST_CLASS
    mixed = (
        "an arena may continue on a machine with the same tag and round differently: "
        "use machines of one kind"
    )
    slow = "simulation is slower, and arenas do not move to machines that have it"
    return judged(
        "cpu",
        tag,
        (not flags, "warn", f"{tag}; the system does not list its features", mixed),
        (is_old, "warn", f"{tag}; no AVX2", slow),
    )


def check_memory(available: int | None, limit: int | None, cores: int) -> Finding:
    """Check that there is memory for a worker per core.

    ``available`` to programs, None if unknown; ``limit`` is what a control group
    leaves.
    """
    known = [size for size in (available, limit) if size is not None]
    if not known:
        return Finding("ok", "memory", "unknown on this system")
    free = min(known)
    text = f"{free / GIB:.1f} GiB free" + " in this control group" * (free == limit)
    fewer = f"--workers {free // _WORKER_BYTES}: a {_WORKER_NEEDS}"
    return judged(
        "memory",
        text,
        (free < _WORKER_BYTES, "fail", text, f"one {_WORKER_NEEDS}"),
        (free < cores * _WORKER_BYTES, "warn", text, fewer),
    )


def check_clock(now_s: float, built_s: float) -> Finding:
    """Check that the clock does not lie before the files of this package."""
    text = strftime("%Y-%m-%d %H:%M:%S UTC", gmtime(now_s))
    built = strftime("%Y-%m-%d", gmtime(built_s))
    why = f"{text}, before this package was installed ({built})"
    advice = "set the clock, for example with NTP: certificates depend on it"
    return judged("clock", text, (now_s < built_s, "fail", why, advice))


def check_viewer(*, has_package: bool, no_screen: str) -> Finding:
    """Check that the viewer can show a run; ``no_screen`` is why it has no window."""
    remote = "use revolve view --serve here, and rerun --connect where one is"
    return judged(
        "viewer",
        "installed",
        (not has_package, "warn", "not installed", install_advice("view")),
        (bool(no_screen), "warn", f"installed, but {no_screen}", remote),
    )


def check_pictures(code: int | None, output: str) -> Finding:
    """Check that robots can be rendered."""
    is_late, late = code is None, "not rendered in time"
    number = code or 0
    ended = f"ended by signal {-number}" if number < 0 else f"exit code {number}"
    advice = (
        f"runs do not need them; {install_advice('pictures')}, or set MUJOCO_GL to "
        "disable if a graphics driver is broken"
    )
    return judged(
        "pictures",
        f"drawn with {output or 'OpenGL'}",
        (is_late, "warn", late, "repeat when idle, or see below"),
        (code != 0, "warn", output or ended, advice),
    )


def check_disk(place: Path, free: int, *, is_writable: bool) -> Finding:
    """Check the disk of run folders."""
    text, closed = f"{free / GIB:.1f} GiB free in {place}", f"{place} cannot be written"
    return judged(
        "disk",
        text,
        (not is_writable, "warn", closed, "change to another directory, or use --out"),
        (free < _LEAST_DISK, "fail", text, _SPACE),
        (free < _LITTLE_DISK, "warn", text, f"a long arena writes gigabytes: {_SPACE}"),
    )


def check_runtime(place: str, error: str) -> Finding:
    """Check the directory where this user's processes meet."""
    text = f"{place}, for this user only"
    return judged("sockets", text, (bool(error), "fail", error, ""))


def check_plugins(modules: Mapping[str, bool]) -> Finding:
    """Check the modules of entry points ``revolve.plugins``: whether each is there."""
    missing = [name for name, is_there in modules.items() if not is_there]
    why = f"no module {', '.join(missing)}"
    advice = "install the packages again, or uninstall them"
    text = ", ".join(modules) or "none installed"
    return judged("plug-ins", text, (bool(missing), "fail", why, advice))
