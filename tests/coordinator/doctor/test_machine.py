"""Checks of this machine, with made-up readings."""

import errno
from pathlib import Path

import pytest

from coordinator.doctor import command, machine
from coordinator.doctor.finding import Finding
from coordinator.doctor.machine import GIB, MIB
from coordinator.doctor.system import available_bytes, end_rendering, start_rendering

V3 = (
    "cx16 lahf_lm popcnt pni sse4_1 sse4_2 ssse3 abm avx avx2 bmi1 bmi2 f16c fma movbe "
    "xsave"
)


PLACE = Path("/x")


@pytest.mark.parametrize(
    ("found", "level", "text"),
    [
        (machine.check_versions({"A": "1", "B": "2"}), "ok", "A 1, B 2"),
        (machine.check_versions({"A": "1", "B": None}), "fail", "B missing"),
        (machine.check_cpu("x86_64", V3.split(), "tag"), "ok", "tag"),
        (machine.check_cpu("x86_64", ["cx16", "popcnt"], "tag"), "warn", "no AVX2"),
        (machine.check_cpu("x86_64", [], "tag"), "warn", "does not list"),
        (machine.check_cpu("aarch64", ["asimd"], "tag"), "ok", "tag"),
        (machine.check_memory(8 * GIB, None, 4), "ok", "8.0 GiB free"),
        (machine.check_memory(8 * GIB, 700 * MIB, 4), "warn", "--workers 2: a worker"),
        (machine.check_memory(100 * MIB, None, 4), "fail", "0.1 GiB free"),
        (machine.check_memory(None, 10 * MIB, 4), "fail", "in this control group"),
        (machine.check_memory(None, None, 4), "ok", "unknown"),
        (machine.check_clock(2000.0, 1000.0), "ok", "1970-01-01 00:33:20 UTC"),
        (machine.check_clock(999.0, 1000.0), "fail", "before this package"),
        (machine.check_viewer(has_package=True, no_screen=""), "ok", "installed"),
        (machine.check_viewer(has_package=True, no_screen="none"), "warn", "but none"),
        (machine.check_viewer(has_package=False, no_screen=""), "warn", "[view]"),
        (machine.check_pictures(0, "egl"), "ok", "egl"),
        (machine.check_pictures(1, "NoPictures: none"), "warn", "NoPictures"),
        (machine.check_pictures(-11, ""), "warn", "signal 11"),
        (machine.check_pictures(None, ""), "warn", "in time"),
        (machine.check_disk(PLACE, 9 * GIB, is_writable=True), "ok", "9.0 GiB free"),
        (machine.check_disk(PLACE, GIB, is_writable=True), "warn", "gigabytes"),
        (machine.check_disk(PLACE, MIB, is_writable=True), "fail", "free some space"),
        (machine.check_disk(PLACE, 9 * GIB, is_writable=False), "warn", "written"),
        (machine.check_runtime("/run/x", ""), "ok", "/run/x, for this user only"),
        (machine.check_runtime("", "others could join"), "fail", "others could join"),
        (machine.check_plugins({}), "ok", "none installed"),
        (machine.check_plugins({"a": True, "b": True}), "ok", "a, b"),
        (machine.check_plugins({"a": True, "b": False}), "fail", "no module b"),
    ],
)
def test_a_reading_has_a_level_and_a_line(
    found: Finding, level: str, text: str
) -> None:
    assert found.level == level
    assert str(found).startswith(f"{level:4}  {found.subject} ")
    assert text in str(found)


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


def test_available_memory_is_read(tmp_path: Path) -> None:
    file = tmp_path / "meminfo"
    assert available_bytes(file) is None
    file.write_text("MemTotal: 9 kB\nMemAvailable:    5 kB\n")
    assert available_bytes(file) == 5 * 1024
