"""Checks of this machine, with made-up readings."""

from pathlib import Path

import pytest

from coordinator.doctor import machine
from coordinator.doctor.machine import GIB, MIB
from coordinator.doctor.system import (
    available_bytes,
    control_group,
    core_quota,
    end_rendering,
    group_bytes,
    start_rendering,
    versions,
)

V3 = (
    "cx16 lahf_lm popcnt pni sse4_1 sse4_2 ssse3 abm avx avx2 bmi1 bmi2 f16c fma movbe "
    "xsave"
)


def test_a_finding_is_one_line_with_the_advice_at_its_end() -> None:
    line = str(machine.check_cores(8, 16, 1.5))
    assert line.startswith("warn  cores ")
    assert line.endswith("8 of 16, limited to the time of 1.5; --workers 1 instead of "
                         "one per core")  # fmt: skip


def test_versions_name_what_is_missing() -> None:
    assert machine.check_versions({"A": "1", "B": "2"}).level == "ok"
    found = machine.check_versions({"A": "1", "B": None})
    assert (found.level, "B missing" in found.text) == ("fail", True)
    assert None not in versions().values()


@pytest.mark.parametrize(
    ("architecture", "flags", "level"),
    [
        ("x86_64", V3, "ok"),
        ("x86_64", "cx16 popcnt", "warn"),
        ("x86_64", "", "warn"),
        ("aarch64", "asimd", "ok"),
    ],
)
def test_cpu(architecture: str, flags: str, level: str) -> None:
    assert machine.check_cpu(architecture, flags.split(), "tag").level == level


def test_cores_are_those_of_affinity_and_quota() -> None:
    assert machine.check_cores(2, 8, None).level == "ok"
    assert machine.check_cores(2, 8, 2.0).level == "ok"
    assert "--workers 3" in machine.check_cores(8, 8, 3.5).advice


@pytest.mark.parametrize(
    ("available", "limit", "level"),
    [
        (8 * GIB, None, "ok"),
        (8 * GIB, 700 * MIB, "warn"),
        (100 * MIB, None, "fail"),
        (None, 10 * MIB, "fail"),
        (None, None, "ok"),
    ],
)
def test_memory(available: int | None, limit: int | None, level: str) -> None:
    assert machine.check_memory(available, limit, 4).level == level


def test_the_advice_about_memory_is_a_number_of_workers_that_fits() -> None:
    assert "--workers 2" in machine.check_memory(700 * MIB, None, 4).advice


def test_a_clock_before_the_package_is_wrong() -> None:
    assert machine.check_clock(2000.0, 1000.0).level == "ok"
    assert machine.check_clock(999.0, 1000.0).level == "fail"


def test_viewer() -> None:
    assert machine.check_viewer(has_package=True, display=":0").level == "ok"
    assert machine.check_viewer(has_package=True, display="").level == "warn"
    assert "[view]" in machine.check_viewer(has_package=False, display=":0").advice


@pytest.mark.parametrize(
    ("code", "output", "level", "text"),
    [
        (0, "egl", "ok", "egl"),
        (1, "NoPictures: none", "warn", "NoPictures"),
        (-11, "", "warn", "signal 11"),
        (None, "", "warn", "in time"),
    ],
)
def test_pictures(code: int | None, output: str, level: str, text: str) -> None:
    found = machine.check_pictures(code, output)
    assert found.level == level
    assert text in found.text


def test_a_renderer_that_crashes_or_hangs_is_a_result(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    crash = "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"
    monkeypatch.setattr("coordinator.doctor.system._RENDER", crash)
    assert end_rendering(start_rendering(), 60.0) == (-11, "")
    monkeypatch.setattr("coordinator.doctor.system._RENDER", "input(); print('x')")
    assert end_rendering(start_rendering(), 60.0)[0] == 1
    monkeypatch.setattr(
        "coordinator.doctor.system._RENDER", "import time; time.sleep(600)"
    )
    assert end_rendering(start_rendering(), 0.2) == (None, "")


@pytest.mark.parametrize(
    ("free", "is_writable", "level"),
    [
        (9 * GIB, True, "ok"),
        (GIB, True, "warn"),
        (MIB, True, "fail"),
        (9 * GIB, False, "warn"),
    ],
)
def test_disk(free: int, level: str, *, is_writable: bool) -> None:
    found = machine.check_disk(Path("/x"), free, is_writable=is_writable)
    assert found.level == level


def test_sockets_and_plugins() -> None:
    assert machine.check_runtime("/run/x", "").level == "ok"
    assert machine.check_runtime("", "others could join").level == "fail"
    assert machine.check_plugins({}).level == "ok"
    assert machine.check_plugins({"a": True, "b": True}).text == "a, b"
    assert "no module b" in machine.check_plugins({"a": True, "b": False}).text


def test_limits_are_read_from_control_groups(tmp_path: Path) -> None:
    own = tmp_path / "own"
    own.write_text("12:pids:/a\n0::/user/x\n")
    group = tmp_path / "user" / "x"
    group.mkdir(parents=True)
    (group / "cpu.max").write_text("150000 100000\n")
    (group / "memory.max").write_text("1000\n")
    (group / "memory.current").write_text("300\n")
    assert control_group(tmp_path, own) == group
    assert core_quota(group) == 1.5
    assert group_bytes(group) == 700
    (group / "cpu.max").write_text("max 100000\n")
    (group / "memory.max").write_text("max\n")
    assert core_quota(group) is None
    assert group_bytes(group) is None
    own.write_text("0::/gone\n")
    assert control_group(tmp_path, own) == tmp_path
    assert core_quota(tmp_path) is None
    assert core_quota(None) is group_bytes(None) is None
    own.write_text("1:cpu:/\n")
    assert control_group(tmp_path, own) is None


def test_available_memory_is_read(tmp_path: Path) -> None:
    file = tmp_path / "meminfo"
    assert available_bytes(file) is None
    file.write_text("MemTotal: 9 kB\nMemAvailable:    5 kB\n")
    assert available_bytes(file) == 5 * 1024
