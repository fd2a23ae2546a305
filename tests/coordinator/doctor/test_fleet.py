"""Checks of hub, rights and certificate, with made-up readings."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from coordinator.doctor.certificate import check_certificate
from coordinator.doctor.hub import check_hub, no_hub, refused
from coordinator.network.probe_service import ROLES, HubProbe
from schema.agent.access import Certificate
from schema.agent.certificate import CertificateFacts
from schema.wire.operator import OperatorReply

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
