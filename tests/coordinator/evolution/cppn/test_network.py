"""Networks: outputs worked out by hand, bytes, rules."""

import msgspec
import numpy as np
import pytest

from coordinator.evolution.cppn.network import (
    INPUTS,
    CppnGenome,
    HiddenNode,
    Link,
    evaluate,
    from_bytes,
    queries,
    reaches,
    to_bytes,
)

OUTPUTS = ("a", "b")


def asked(x: float) -> dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]]:
    return queries(np.array([[x, 0.0, 0.0, 0.0]]), np.array([[0.0, 3.0, 4.0, 2.0]]))


def value(*links: Link, nodes: tuple[HiddenNode, ...] = (), x: float = 0.5) -> float:
    """Return output ``a`` for x1 = x."""
    return float(evaluate(CppnGenome(nodes, links), asked(x), ("a",))["a"][0])


def test_inputs_of_a_query() -> None:
    columns = {name: float(column[0]) for name, column in asked(0.5).items()}
    assert columns == dict(
        zip(INPUTS, (1.0, 0.5, 0.0, 0.0, 0.0, 0.0, 3.0, 4.0, 2.0, 5.0), strict=True)
    )


@pytest.mark.parametrize(
    ("weight", "output"), [(2.0, 0.5), (-2.0, -0.5), (0.0, 0.0), (6.0, 0.75)]
)
def test_an_output_saturates_its_weighted_sum(weight: float, output: float) -> None:
    # x1 = 0.5: a / (1 + |a|) of 0.5 times the weight.
    assert value(Link("x1", "a", weight)) == output


def test_inputs_are_added() -> None:
    # 1 * 0.5 - 3 * 1 + 0.5 * 5 = 0; and with y2 = 3 times 1: 3 / 4.
    links = Link("x1", "a", 1.0), Link("bias", "a", -3.0), Link("distance", "a", 0.5)
    assert value(*links) == 0.0
    assert value(*links, Link("y2", "a", 1.0)) == 0.75


@pytest.mark.parametrize(
    ("function", "x", "inner"),
    [
        ("line", -0.25, -0.25),
        ("bell", 0.0, 1.0),
        ("bell", -2.0, 0.2),
        ("absolute", -2.0, 2.0),
        ("saturating", -1.0, -0.5),
        # The extremes and zeros of sin(pi x).
        ("wave", 0.5, 1.0),
        ("wave", -0.5, -1.0),
        ("wave", 1.5, -1.0),
        ("wave", 2.5, 1.0),
        ("wave", 3.0, 0.0),
        ("wave", 0.25, 0.75),
    ],
)
def test_a_hidden_node_applies_its_function(
    function: str, x: float, inner: float
) -> None:
    links = Link("#1", "a", 1.0), Link("x1", "#1", 1.0)
    got = value(*links, nodes=(HiddenNode("#1", function),), x=x)
    assert got == pytest.approx(inner / (1.0 + abs(inner)), abs=1e-15)


def test_disabled_connections_and_unconnected_outputs_give_0() -> None:
    assert value(Link("x1", "a", 2.0, is_enabled=False)) == 0.0
    assert value(Link("x1", "b", 2.0)) == 0.0


def test_a_chain_of_nodes_stays_finite() -> None:
    ids = [f"#{number:03}" for number in range(60)]
    ends = zip(["bias", *ids], [*ids, "a"], strict=True)
    nodes = tuple(HiddenNode(each, "line") for each in ids)
    links = [Link(source, target, 3.0) for source, target in ends]
    # The sum 3 * 100 is limited to 100.
    assert value(*links, nodes=nodes) == 100.0 / 101.0


def test_rows_are_independent() -> None:
    points = np.random.default_rng(1).uniform(-3, 3, (50, 4))
    links = tuple(Link(name, "#1", 0.7) for name in sorted(INPUTS))
    network = CppnGenome((HiddenNode("#1", "wave"),), (Link("#1", "a", 1.3), *links))
    together = evaluate(network, queries(points, points[::-1]), ("a",))["a"]
    for row in range(50):
        pair = points[row : row + 1], points[49 - row : 50 - row]
        assert evaluate(network, queries(*pair), ("a",))["a"][0] == together[row]


def test_a_path_counts_disabled_connections() -> None:
    links = [Link("x1", "#1", 1.0, is_enabled=False), Link("#1", "#2", 1.0)]
    assert reaches(links, "x1", "#2")
    assert not reaches(links, "#2", "x1")
    assert reaches(links, "#1", "#1")


GOOD = CppnGenome(
    (HiddenNode("#1", "bell"), HiddenNode("#2", "wave")),
    (Link("#1", "#2", 0.1), Link("#2", "a", -3.0), Link("x1", "#1", 1 / 3, False)),
)


def test_bytes_give_the_network_back() -> None:
    assert from_bytes(to_bytes(GOOD), OUTPUTS) == GOOD


@pytest.mark.parametrize(
    ("network", "problem"),
    [
        (CppnGenome(GOOD.nodes[::-1], GOOD.links), "sorted by id"),
        (CppnGenome((HiddenNode("a", "bell"),), ()), "apart from all others"),
        (CppnGenome((HiddenNode("#1", "cosine"),), ()), "must be one of line, wave"),
        (CppnGenome(GOOD.nodes, GOOD.links[::-1]), "sorted by source and target"),
        (CppnGenome((), (Link("x1", "c", 1.0),)), "no node of its own"),
        (CppnGenome((), (Link("a", "b", 1.0),)), "no node of its own"),
        (CppnGenome((), (Link("x1", "a", 3.1),)), "weight must be in"),
        (CppnGenome((), (Link("x1", "a", float("nan")),)), "weight must be in"),
        (
            CppnGenome(GOOD.nodes, (Link("#1", "#2", 1.0), Link("#2", "#1", 1.0))),
            "part of a cycle",
        ),
        (CppnGenome(GOOD.nodes, (Link("#1", "#1", 1.0),)), "part of a cycle"),
    ],
)
def test_a_network_that_breaks_a_rule_is_refused(
    network: CppnGenome, problem: str
) -> None:
    with pytest.raises(ValueError, match=problem):
        from_bytes(to_bytes(network), OUTPUTS)


@pytest.mark.parametrize("data", [b"", b"\x00", b"cppn", to_bytes(GOOD)[:-1]])
def test_other_bytes_are_refused(data: bytes) -> None:
    with pytest.raises((msgspec.DecodeError, msgspec.ValidationError)):
        from_bytes(data, OUTPUTS)
