"""What a machine has: memory, cores and kind of processor."""

import math
import os
import re
from pathlib import Path

import pytest

from coordinator.doctor.system import group_bytes
from schema.agent import machine
from schema.agent.machine import (
    MOST_SHARDS,
    SHARD_BYTES,
    core_quota,
    cpu_class,
    cpu_flags,
    memory_bytes,
    platform_tag,
    shards_that_fit,
)
from schema.agent.supervisor import cores

MACHINE = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.parametrize(
    ("memory", "processes", "shards"),
    [
        (80 * SHARD_BYTES, 2, 20),
        (80 * SHARD_BYTES, 1, 40),
        (SHARD_BYTES, 1, 1),
        (0, 9, 1),
        (10**18, 1, MOST_SHARDS),
    ],
)
def test_half_of_the_memory_is_shared(memory: int, processes: int, shards: int) -> None:
    assert shards_that_fit(memory, processes) == shards


@pytest.fixture
def groups(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of control groups; this process is in ``/a/b``."""
    own = tmp_path / "own"
    own.write_text("4:memory:/a/b\n2:cpu,cpuacct:/a/b\n0::/a/b\n")
    monkeypatch.setattr(machine, "_OWN", own)
    monkeypatch.setattr(machine, "_ROOT", tmp_path / "groups")
    return tmp_path / "groups"


def _write(folder: Path, **files: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name.replace("__", ".")).write_text(text)


@pytest.mark.usefixtures("groups")
def test_without_limits_a_process_has_the_whole_machine() -> None:
    assert (core_quota(), memory_bytes(), group_bytes()) == (math.inf, MACHINE, None)


# The root is where a container sees its own group; a parent's limit counts as well.
@pytest.mark.parametrize("place", ["", "a", "a/b"])
def test_limits_of_version_2(groups: Path, place: str) -> None:
    _write(groups / "a" / "b", cpu__max="max 100000\n", memory__max="max\n")
    _write(groups / place, cpu__max="150000 100000\n", memory__max="1000\n")
    assert (core_quota(), memory_bytes(), group_bytes()) == (1.5, 1000, None)
    _write(groups / place, memory__current="300\n")
    assert group_bytes() == 700


@pytest.mark.parametrize("place", ["", "a", "a/b"])
def test_limits_of_version_1(groups: Path, place: str) -> None:
    cpu, memory = groups / "cpu,cpuacct" / place, groups / "memory" / place
    _write(cpu, cpu__cfs_quota_us="-1\n", cpu__cfs_period_us="100000\n")
    _write(memory, memory__limit_in_bytes=f"{2**63 - 4096}\n")
    assert (core_quota(), memory_bytes()) == (math.inf, MACHINE)
    _write(cpu, cpu__cfs_quota_us="250000\n")
    _write(memory, memory__limit_in_bytes="1000\n", memory__usage_in_bytes="1300\n")
    assert (core_quota(), memory_bytes(), group_bytes()) == (2.5, 1000, 0)


@pytest.mark.parametrize(
    ("quota", "expected"), [("max", 8), ("250000", 2), ("20000", 1), ("1600000", 8)]
)
def test_a_containers_quota_counts_as_cores(
    groups: Path, monkeypatch: pytest.MonkeyPatch, quota: str, expected: int
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(8), raising=False)
    _write(groups, cpu__max=f"{quota} 100000\n")
    assert cores() == expected


V2 = ["cx16", "lahf_lm", "popcnt", "pni", "sse4_1", "sse4_2", "ssse3"]
V3 = [*V2, *["abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe", "xsave"]]
V4 = [*V3, *["avx512bw", "avx512cd", "avx512dq", "avx512f", "avx512vl"]]


@pytest.mark.parametrize(
    ("machine", "flags", "expected"),
    [
        ("x86_64", [], "x86_64_v1"),
        ("x86_64", V2, "x86_64_v2"),
        ("amd64", [*V3, "sse"], "x86_64_v3"),
        ("x86_64", V4, "x86_64_v4"),
        # A level without the one before it is not reached.
        ("x86_64", [flag for flag in V4 if flag != "fma"], "x86_64_v2"),
        ("arm64", ["asimd"], "arm64"),
    ],
)
def test_cpu_class(machine: str, flags: list[str], expected: str) -> None:
    assert cpu_class(machine, flags) == expected


def test_flags_are_those_of_the_first_cpu(tmp_path: Path) -> None:
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text("processor\t: 0\nflags\t\t: fpu sse\n\nflags\t: fpu\n", "utf-8")
    assert cpu_flags(cpuinfo) == {"fpu", "sse"}
    assert cpu_flags(tmp_path / "none") == frozenset()


def test_the_tag_names_system_cpu_and_libraries() -> None:
    tag = platform_tag()
    assert re.fullmatch(r"\w+-\w+-\S+-mujoco[\d.]+-numpy[\d.]+", tag)
    assert platform_tag() == tag
