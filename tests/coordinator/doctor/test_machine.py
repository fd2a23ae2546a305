"""Checks of this machine, with made-up readings."""

import errno
from pathlib import Path

import pytest

from coordinator.doctor import command, machine
from coordinator.doctor.machine import GIB, MIB
from coordinator.doctor.system import (
    available_bytes,
    end_rendering,
    start_rendering,
    versions,
)

V3 = (
    "cx16 lahf_lm popcnt pni sse4_1 sse4_2 ssse3 abm avx avx2 bmi1 bmi2 f16c fma movbe "
    "xsave"
)


def test_a_finding_is_one_line_with_the_advice_at_its_end() -> None:
    line = str(machine.check_memory(800 * MIB, None, 8))
    assert line.startswith("warn  memory ")
    assert line.endswith("0.8 GiB free; --workers 2: a worker needs about 300 MiB")


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


@pytest.mark.parametrize("has_locks", [True, False])
def test_output_folder_without_locks_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, has_locks: bool
) -> None:
    def flock(*_: object) -> None:
        if not has_locks:
            raise OSError(errno.ENOLCK, "No locks available")

    (tmp_path / "runs").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("fcntl.flock", flock)
    told = [str(each) for each in command._machine() if "locks" in each.text]
    assert len(told) == (not has_locks)
    assert all(f"no file locks in {tmp_path / 'runs'}; do" in line for line in told)


def test_sockets_and_plugins() -> None:
    assert machine.check_runtime("/run/x", "").level == "ok"
    assert machine.check_runtime("", "others could join").level == "fail"
    assert machine.check_plugins({}).level == "ok"
    assert machine.check_plugins({"a": True, "b": True}).text == "a, b"
    assert "no module b" in machine.check_plugins({"a": True, "b": False}).text


def test_available_memory_is_read(tmp_path: Path) -> None:
    file = tmp_path / "meminfo"
    assert available_bytes(file) is None
    file.write_text("MemTotal: 9 kB\nMemAvailable:    5 kB\n")
    assert available_bytes(file) == 5 * 1024
