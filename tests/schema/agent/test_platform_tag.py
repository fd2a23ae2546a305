"""Machines with one tag compute the same bits."""

import re
from pathlib import Path

import pytest

from schema.agent.platform_tag import cpu_class, cpu_flags, platform_tag

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
