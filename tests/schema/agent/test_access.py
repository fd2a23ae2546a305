"""Keys of processes, and which of them each role may use at a hub."""

from pathlib import Path

import pytest
import zenoh
from hypothesis import given, settings
from hypothesis import strategies as st

from schema.agent.access import (
    Certificate,
    CertificateRole,
    access_control,
    permissions,
    read_certificates,
)
from schema.agent.topics import (
    FleetMember,
    check_name,
    key_of_all,
    member_of,
    unique_name,
)
from schema.errors import MalformedMessage, NetworkError

WORKER = FleetMember("default", "worker", "a-0.1234abcd")
OTHER = FleetMember("default", "worker", "b-0.1234abcd")
ANALYZER = FleetMember("default", "analyzer", "a-0.1234abcd")
COORDINATOR = FleetMember("default", "coordinator", "c.1234abcd")


def may(role: CertificateRole, name: str, flow: str, message: str, key: str) -> bool:
    """Return whether a certificate's rules include a message's key expression."""
    wanted = zenoh.KeyExpr(key)
    return any(
        zenoh.KeyExpr(allowed).includes(wanted)
        for each in permissions(Certificate(name, role))
        if each.flow == flow and message in each.messages
        for allowed in each.keys
    )


def test_worker_uses_its_own_keys_only() -> None:
    for message, key in [
        ("declare_queryable", WORKER.jobs),
        ("declare_queryable", WORKER.info),
        ("reply", WORKER.jobs),
        ("declare_subscriber", WORKER.cancelled),
        ("liveliness_token", WORKER.alive),
        ("put", WORKER.poses(3)),
    ]:
        assert may("worker", "a", "ingress", message, key)
        stolen = key.replace("/a-0", "/b-0")
        assert not may("worker", "a", "ingress", message, stolen)
        assert not may("worker", "a", "ingress", message, key.replace("/w/", "/an/"))
        assert not may("worker", "a", "ingress", message, key.replace("/w/", "/co/"))


@pytest.mark.parametrize("role", ["worker", "analyzer", "viewer", "operator"])
def test_only_coordinators_give_and_cancel_jobs(role: CertificateRole) -> None:
    for member in (WORKER, ANALYZER):
        assert may("coordinator", "c", "ingress", "query", member.jobs)
        assert may("coordinator", "c", "ingress", "put", member.cancelled)
        assert not may(role, "x", "ingress", "query", member.jobs)
        assert not may(role, "x", "ingress", "put", member.cancelled)


@pytest.mark.parametrize("role", ["worker", "analyzer", "viewer", "coordinator"])
def test_only_operators_give_orders(role: CertificateRole) -> None:
    assert may("operator", "o", "ingress", "query", COORDINATOR.command)
    assert not may(role, "x", "ingress", "query", COORDINATOR.command)


@pytest.mark.parametrize("role", ["viewer", "operator"])
def test_viewers_read_only(role: CertificateRole) -> None:
    assert may(role, "v", "ingress", "query", COORDINATOR.state)
    assert may(
        role,
        "v",
        "ingress",
        "declare_subscriber",
        key_of_all("default", "coordinator", "events"),
    )
    assert may(
        role,
        "v",
        "ingress",
        "declare_subscriber",
        key_of_all("default", "worker", "arena/*/pose"),
    )
    assert may(
        role, "v", "ingress", "declare_liveliness_subscriber",
        key_of_all("default", "coordinator", "alive"),
    )  # fmt: skip
    for message in ("put", "reply", "declare_queryable", "liveliness_token"):
        assert not may(role, "v", "ingress", message, COORDINATOR.events)


def test_worker_gets_no_job_of_another() -> None:
    assert may("worker", "a", "egress", "query", WORKER.jobs)
    assert not may("worker", "a", "egress", "query", OTHER.jobs)


def test_coordinator_cannot_take_another_name() -> None:
    assert may("coordinator", "c", "ingress", "liveliness_token", COORDINATOR.alive)
    stolen = COORDINATOR.alive.replace("/c.", "/d.")
    assert not may("coordinator", "c", "ingress", "liveliness_token", stolen)


@pytest.mark.parametrize(
    ("first", "second"), [("a", "a"), ("a", "a-1"), ("lab.x", "lab"), ("a", "")]
)
def test_names_whose_keys_overlap_are_refused(first: str, second: str) -> None:
    with pytest.raises(NetworkError):
        access_control([Certificate(first, "worker"), Certificate(second, "viewer")])


def test_similar_names_are_allowed() -> None:
    access_control([Certificate("a1", "worker"), Certificate("a12", "worker")])


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{}",
        b'[{"name": "a"}]',
        b'[{"name": "a", "role": "king"}]',
        b'[{"name": "a", "role": "worker", "more": 1}]',
        b"[" * 100_000,
        b"\xff",
    ],
)
def test_invalid_file_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "access.json"
    file.write_bytes(content)
    with pytest.raises(NetworkError, match="must be a JSON list") as caught:
        read_certificates(file)
    assert "\n" not in str(caught.value)


def test_missing_file_is_not_called_invalid(tmp_path: Path) -> None:
    file = tmp_path / "access.json"
    with pytest.raises(NetworkError) as caught:
        read_certificates(file)
    assert str(caught.value) == f"{file}: cannot be read: No such file or directory"


@pytest.mark.parametrize(
    ("member", "prefix"),
    [
        (FleetMember("f", "worker", "box-0.1a"), "revolve/f/w/box-0.1a/"),
        (FleetMember("f", "analyzer", "box"), "revolve/f/an/box/"),
        (FleetMember("f", "coordinator", "c_1"), "revolve/f/co/c_1/"),
    ],
)
def test_all_keys_of_a_process_have_one_prefix(
    member: FleetMember, prefix: str
) -> None:
    keys = [member.alive, member.info, member.jobs]
    assert keys == [prefix + "alive", prefix + "info", prefix + "jobs"]
    assert member_of(member.alive) == member


def test_tokens_of_one_role_are_found_by_one_expression() -> None:
    expression = zenoh.KeyExpr(key_of_all("f", "worker", "alive"))
    assert expression.includes(FleetMember("f", "worker", "a.b").alive)
    assert not expression.intersects(FleetMember("f", "analyzer", "a").alive)
    assert not expression.intersects(FleetMember("g", "worker", "a").alive)
    assert not expression.intersects(FleetMember("f", "worker", "a").jobs)


@settings(derandomize=True, deadline=None)
@given(
    st.text() | st.from_regex(r"revolve/[^/]*/(w|an|co|x)/[^/]*/alive", fullmatch=True)
)
def test_any_text_is_a_token_or_malformed(key: str) -> None:
    try:
        member = member_of(key)
    except MalformedMessage:
        return
    assert member.alive == key
    zenoh.KeyExpr(key)  # raises unless it is one


@pytest.mark.parametrize("name", ["a", "A9", "host-1.2_x", "x" * 96])
def test_valid_names_are_returned(name: str) -> None:
    assert check_name(name, "--name") == name


@pytest.mark.parametrize(
    "name",
    ["", "a/b", "*", "a$b", "a#b", "a?b", "@a", "-a", ".a", "ä", "a\n", "x" * 97],
)
def test_invalid_names_are_refused(name: str) -> None:
    with pytest.raises(NetworkError, match=r"^--name: must be 1 to 96 letters"):
        check_name(name, "--name")


def test_process_that_restarts_has_another_name() -> None:
    names = {check_name(unique_name("box-0"), "name") for _ in range(100)}
    assert len(names) == 100
