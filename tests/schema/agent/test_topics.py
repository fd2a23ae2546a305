"""Zenoh key expressions of agents and coordinators."""

import pytest
import zenoh
from hypothesis import given, settings
from hypothesis import strategies as st

from schema.agent.topics import Member, agents_alive, check_name, member_of, unique_name
from schema.errors import MalformedMessage, NetworkError


@pytest.mark.parametrize(
    ("member", "prefix"),
    [
        (Member("f", "worker", "box-0.1a"), "revolve/f/w/box-0.1a/"),
        (Member("f", "analyzer", "box"), "revolve/f/an/box/"),
        (Member("f", "coordinator", "c_1"), "revolve/f/co/c_1/"),
    ],
)
def test_all_keys_of_a_process_have_one_prefix(member: Member, prefix: str) -> None:
    keys = [member.alive, member.info, member.jobs]
    assert keys == [prefix + "alive", prefix + "info", prefix + "jobs"]
    assert member_of(member.alive) == member


def test_tokens_of_one_role_are_found_by_one_expression() -> None:
    expression = zenoh.KeyExpr(agents_alive("f", "worker"))
    assert expression.includes(Member("f", "worker", "a.b").alive)
    assert not expression.intersects(Member("f", "analyzer", "a").alive)
    assert not expression.intersects(Member("g", "worker", "a").alive)
    assert not expression.intersects(Member("f", "worker", "a").jobs)


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
