"""Checks of a machine, and with made-up readings of hub, rights and certificate."""

import errno
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from coordinator.doctor import command, machine
from coordinator.doctor.certificate import check_certificate
from coordinator.doctor.hub import check_hub, no_hub, refused
from coordinator.doctor.machine import GIB, MIB, Finding
from coordinator.doctor.system import available_bytes, end_rendering, start_rendering
from coordinator.network.client_service import ROLES, HubProbe
from schema.agent.access import Certificate
from schema.agent.certificate import CertificateFacts
from schema.wire.operator import OperatorReply

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


NOW = datetime(2026, 1, 1, tzinfo=UTC)
DAY = timedelta(days=1)
FACTS = CertificateFacts("a", NOW - DAY, NOW + 90 * DAY, is_issued=True, fits_key=True)
LISTED = (Certificate("b", "viewer"), Certificate("a", "worker"))
SEEN = HubProbe("", 0.001, ("boss.1",), offset_s=0.1, roles=("worker",))


@pytest.mark.parametrize(
    ("change", "level", "text"),
    [
        ({}, "ok", "'a', worker, 90 days left"),
        ({"is_issued": False}, "fail", "authority"),
        ({"fits_key": False}, "fail", "--tls-key"),
        ({"begins": NOW + DAY}, "fail", "valid from 2026-01-02"),
        ({"ends": NOW}, "fail", "expired on 2026-01-01"),
        ({"ends": NOW + 13 * DAY}, "warn", "13 days left"),
        ({"name": "c"}, "fail", "not in --access"),
    ],
)
def test_certificate(change: dict[str, Any], level: str, text: str) -> None:
    found, key = check_certificate(replace(FACTS, **change), 0o600, LISTED, NOW)
    assert (found.level, key.level) == (level, "ok")
    assert text in found.text
    assert bool(found.advice) == (level != "ok")


def test_the_role_is_unknown_without_the_list() -> None:
    found, _ = check_certificate(FACTS, 0o600, None, NOW)
    assert (found.level, found.text) == ("ok", "'a', 90 days left")


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660])
def test_a_key_that_others_read_fails(mode: int) -> None:
    _, key = check_certificate(FACTS, mode, None, NOW)
    assert key.level == "fail"
    assert f"{mode:o}" in key.text


@pytest.mark.parametrize(
    ("change", "subject", "level", "text"),
    [
        ({}, "hub", "ok", "tls/h:1, round trip 1.0 ms"),
        ({"round_trip_s": None}, "hub", "fail", "does not reply"),
        ({"round_trip_s": 0.5}, "hub", "warn", "a slow link"),
        ({}, "rights", "ok", "those of worker"),
        ({"roles": None}, "rights", "ok", "all: no certificates at this address"),
        ({"roles": ()}, "rights", "ok", "those of viewer"),
        (
            {"roles": (), "replies": {"boss.1": OperatorReply("")}},
            "rights",
            "ok",
            "those of operator",
        ),
        ({"roles": ROLES}, "rights", "warn", "start it with --access"),
        ({"roles": (), "coordinators": ()}, "rights", "warn", "was revoked"),
        ({}, "coordinators", "ok", "boss.1"),
        ({"malformed": ("boss.1",)}, "coordinators", "warn", "another version"),
        ({}, "its clock", "ok", "+0.10 s"),
        ({"offset_s": -6.0}, "its clock", "warn", "set both clocks"),
    ],
)
def test_what_is_seen_at_a_hub(
    change: dict[str, Any], subject: str, level: str, text: str
) -> None:
    found = {
        each.subject: each for each in check_hub(replace(SEEN, **change), "tls/h:1")
    }
    assert found[subject].level == level
    assert text in str(found[subject])


def test_only_what_was_seen_is_told() -> None:
    def subjects(**change: object) -> list[str]:
        found = check_hub(replace(SEEN, **change), "tls/h:1")  # type: ignore[arg-type]
        return [each.subject for each in found]

    assert subjects() == ["hub", "rights", "coordinators", "its clock"]
    assert subjects(offset_s=None) == ["hub", "rights", "coordinators"]
    assert subjects(round_trip_s=None) == ["hub"]


def test_names_are_limited() -> None:
    names = tuple(f"c{number}" for number in range(7))
    (line,) = (
        each.text
        for each in check_hub(replace(SEEN, coordinators=names), "tls/h:1")
        if each.subject == "coordinators"
    )
    assert line == "c0, c1, c2, c3, c4 and 2 more"


def test_a_hub_that_is_missing_fails_only_if_the_user_named_it() -> None:
    assert no_hub("hub", "Connection refused", is_wanted=True).level == "fail"
    idle = no_hub("hub", "Connection refused", is_wanted=False)
    assert (idle.level, idle.text[:15]) == ("ok", "none is running")
    assert refused("x" * 500).level == "fail"
