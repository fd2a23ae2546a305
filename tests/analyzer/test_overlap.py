"""Intersection of boxes: worked by hand, and against two slow obvious oracles."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from analyzer.report import Boxes, intersecting_parts, place_boxes, separation
from schema.experiment.document import Vetting
from schema.parts import BUILT_IN, Box, Shape
from schema.robot.robot import Part, Robot
from schema.robot.trace import Floats

OVERLAP = Vetting(mode="overlap", tolerance_m=1e-6)
CONTACT = Vetting(mode="contact", tolerance_m=1e-6)
GREY = (0.5, 0.5, 0.5)
CORE = Part("Core", -1, -1, -1, 0, GREY)


def boxes_of(rotation: Floats, centre: Floats, size: Floats) -> Boxes:
    """Return boxes of one part each."""
    half = np.asarray(size) / 2
    reach = (np.abs(rotation) @ half[:, :, None])[:, :, 0]
    count = np.ones(len(half), dtype=np.intp)
    return Boxes(count, rotation, centre, half, centre - reach, centre + reach, 0.0)


def shaped(*boxes: Box) -> Callable[[tuple[float, ...]], Shape]:
    """Return the shape function of a part with a brick's slots."""
    shape = Shape(boxes, BUILT_IN["FixedBrick"].shape(()).slots)
    return lambda _values: shape


def turned(rng: np.random.Generator) -> Floats:
    """Return a random rotation."""
    matrix, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    if np.linalg.det(matrix) < 0:
        matrix[:, 0] *= -1
    return np.asarray(matrix, dtype=np.float64)


def about_z(angle: float) -> Floats:
    """Return a rotation about z."""
    s, c = math.sin(angle), math.cos(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def pair(second: Floats, centre: tuple[float, float, float]) -> float:
    """Return the separation of a unit cube at the origin and a turned one."""
    rotation = np.stack([np.eye(3), second])
    centres = np.array([(0.0, 0.0, 0.0), centre])
    boxes = boxes_of(rotation, centres, np.ones((2, 3)))
    return float(separation(boxes, np.array([0]), np.array([1]))[0])


def shared_depth(boxes: Boxes) -> float:
    """Return by how much two boxes can be shrunk and still share a point [m].

    A linear programme: the point's and the margin's, every face one inequality.
    Negative if they are apart.
    """
    rows, limits = [], []
    for index in range(2):
        for axis in range(3):
            normal = boxes.rotation[index][:, axis]
            for sign in (1.0, -1.0):
                rows.append([*(sign * normal), 1.0])
                place = sign * float(normal @ boxes.centre[index])
                limits.append(boxes.half[index][axis] + place)
    free = [(None, None)] * 4
    result = linprog([0, 0, 0, -1], A_ub=rows, b_ub=limits, bounds=free)
    assert result.x is not None
    return float(result.x[3])


# --- by hand -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("rotation", "centre", "expected"),
    [
        (np.eye(3), (1.5, 0.0, 0.0), 0.5),
        (np.eye(3), (1.0, 0.3, 0.0), 0.0),
        (np.eye(3), (0.0, 0.75, 0.2), -0.25),
        # A corner edge of the turned cube reaches out by sqrt(1/2).
        (about_z(math.pi / 4), (1.5, 0.0, 0.0), 1.0 - math.sqrt(0.5)),
        (about_z(math.pi / 4), (1.0, 0.0, 0.0), 0.5 - math.sqrt(0.5)),
        # Corner towards corner along the diagonal: the turned cube's face is near.
        (about_z(math.pi / 4), (1.0, 1.0, 0.0), math.sqrt(2) - math.sqrt(0.5) - 0.5),
        # One inside the other, same centre: out by half of each.
        (np.eye(3), (0.0, 0.0, 0.0), -1.0),
    ],
)
def test_separation_of_unit_cubes(
    rotation: Floats, centre: tuple[float, float, float], expected: float
) -> None:
    assert pair(rotation, centre) == pytest.approx(expected, abs=1e-12)


def test_crossed_edges_are_separated_by_their_cross_product_only() -> None:
    # Two long sticks cross at right angles, each on edge: the gap lies along z.
    on_edge = np.array(
        [[1.0, 0.0, 0.0], [0.0, math.sqrt(0.5), -math.sqrt(0.5)], [0.0, 0, 0]]
    )
    on_edge[2] = np.cross(on_edge[0], on_edge[1])
    rotation = np.stack([on_edge, about_z(math.pi / 2) @ on_edge])
    sizes = np.array([(4.0, 1.0, 1.0), (4.0, 1.0, 1.0)])
    height = math.sqrt(2) + 0.01
    boxes = boxes_of(rotation, np.array([(0.0, 0, 0), (0.0, 0, height)]), sizes)
    found = separation(boxes, np.array([0]), np.array([1]))[0]
    assert found == pytest.approx(0.01, abs=1e-12)


def test_bricks_on_neighbouring_faces_of_a_brick_touch_along_an_edge() -> None:
    # Core - brick; on the brick's right and back face one brick each. The one on
    # the right also touches the core's face.
    robot = Robot(
        (
            CORE,
            Part("FixedBrick", 0, 1, 0, 0, GREY),
            Part("FixedBrick", 1, 1, 0, 0, GREY),
            Part("FixedBrick", 1, 2, 0, 0, GREY),
        )
    )
    boxes = place_boxes(robot, BUILT_IN)
    gap = separation(boxes, np.array([2]), np.array([3]))[0]
    assert gap == pytest.approx(0.0, abs=1e-12)
    assert intersecting_parts(boxes, robot, OVERLAP) == ()
    assert intersecting_parts(boxes, robot, CONTACT) == ((0, 3), (2, 3))


def test_bricks_around_a_corner_of_the_core_are_apart_by_the_overhang() -> None:
    robot = Robot(
        (
            CORE,
            Part("FixedBrick", 0, 1, 0, 0, GREY),
            Part("FixedBrick", 0, 2, 0, 0, GREY),
        )
    )
    boxes = place_boxes(robot, BUILT_IN)
    gap = separation(boxes, np.array([1]), np.array([2]))[0]
    assert gap == pytest.approx(0.045 - 0.0205, abs=1e-12)
    assert intersecting_parts(boxes, robot, CONTACT) == ()


def test_a_ring_of_bricks_intersects_its_start() -> None:
    # Four left turns in a row: the fifth brick stands where the first one does.
    ring = [CORE, Part("FixedBrick", 0, 1, 0, 0, GREY)]
    ring += [Part("FixedBrick", index, 2, 0, 0, GREY) for index in range(1, 5)]
    robot = Robot(tuple(ring))
    boxes = place_boxes(robot, BUILT_IN)
    assert np.allclose(boxes.centre[1], boxes.centre[5], atol=1e-12)
    found = intersecting_parts(boxes, robot, OVERLAP)
    assert (1, 5) in found
    assert (4, 5) not in found


def test_pads_of_a_touch_sensor_reach_beyond_the_slot_they_sit_on() -> None:
    # In the original the pads reach |y| = 19.5 mm, the base 17 mm.
    robot = Robot((CORE, Part("TouchSensor", 0, 1, 0, 0, GREY)))
    boxes = place_boxes(robot, BUILT_IN)
    lower, upper = boxes.lower[2:], boxes.upper[2:]
    widest = max(np.abs(lower).max(), np.abs(upper).max())
    reach = (upper[0] - lower[0]) / 2
    side = np.sort(np.abs(boxes.centre[2] - boxes.centre[1]) + reach)
    assert 0.0195 in side.round(12)
    assert widest == pytest.approx(0.045 + 0.0105, abs=1e-12)
    assert intersecting_parts(boxes, robot, CONTACT) == ()


@pytest.mark.parametrize(("half_width", "expected"), [(0.1, ()), (0.05, ((0, 2),))])
def test_boxes_decide_if_hulls_meet(
    half_width: float, expected: tuple[tuple[int, int], ...]
) -> None:
    # Core, brick, and a fork whose tines reach back to both sides of the core.
    tine = (0.02, 0.3, 0.02)
    tines = [Box(f"{x}", tine, (x, 0.0, 0.0), 0.1) for x in (-half_width, half_width)]
    fork = replace(BUILT_IN["FixedBrick"], name="Fork", shape=shaped(*tines))
    chain = (CORE, Part("FixedBrick", 0, 1, 0, 0, GREY), Part("Fork", 1, 1, 0, 0, GREY))
    robot = Robot(chain)
    boxes = place_boxes(robot, {**BUILT_IN, "Fork": fork})
    assert boxes.count.tolist() == [1, 1, 2]
    assert (boxes.lower[2:].min(axis=0) < boxes.upper[0]).all()
    assert (boxes.upper[2:].max(axis=0) > boxes.lower[0]).all()
    assert intersecting_parts(boxes, robot, OVERLAP) == expected


@pytest.mark.parametrize("ghosts", [0, 1, 2])
def test_parts_without_boxes_keep_all_boxes_of_the_part_before(ghosts: int) -> None:
    # As above, but the tine that meets the core is the last of the boxes.
    tine = (0.02, 0.3, 0.02)
    tines = [Box(f"{x}", tine, (x, 0.0, 0.0), 0.1) for x in (0.2, -0.05)]
    brick = BUILT_IN["FixedBrick"]
    fork = replace(brick, name="Fork", shape=shaped(*tines))
    ghost = replace(brick, name="Ghost", shape=shaped())
    parts = [CORE, Part("FixedBrick", 0, 1, 0, 0, GREY), Part("Fork", 1, 1, 0, 0, GREY)]
    parts += [Part("Ghost", 0, slot, 0, 0, GREY) for slot in (0, 2)[:ghosts]]
    robot = Robot(tuple(parts))
    boxes = place_boxes(robot, {**BUILT_IN, "Fork": fork, "Ghost": ghost})
    assert boxes.count.tolist() == [1, 1, 2] + [0] * ghosts
    assert intersecting_parts(boxes, robot, OVERLAP) == ((0, 2),)


@pytest.mark.parametrize("order", [("Ghost", "FixedBrick"), ("FixedBrick", "Ghost")])
def test_a_part_without_boxes_intersects_no_part(order: tuple[str, str]) -> None:
    ghost = replace(BUILT_IN["FixedBrick"], name="Ghost", shape=shaped())
    space = {**BUILT_IN, "Ghost": ghost}
    # By so wide a tolerance even opposite bricks would meet.
    arms = [Part(kind, 0, slot, 0, 0, GREY) for slot, kind in enumerate(order)]
    robot = Robot((CORE, *arms))
    boxes = place_boxes(robot, space)
    assert len(boxes.half) == 2
    assert intersecting_parts(boxes, robot, Vetting("contact", 1.0)) == ()


@pytest.mark.parametrize(
    ("gap", "overlap", "contact"),
    [
        (2e-6, False, False),
        (0.5e-6, False, True),
        (0.0, False, True),
        (-0.5e-6, False, True),
        (-2e-6, True, True),
    ],
)
@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_the_tolerance_decides_both_ways(
    gap: float, angle: float, *, overlap: bool, contact: bool
) -> None:
    # A turned cube whose side faces a wide wall, so that the gap is exact.
    rotation = np.stack([about_z(angle)] * 3)
    shift = about_z(angle) @ np.array([1.0 + gap, 0.0, 0.0])
    far = np.array([50.0, 0.0, 0.0])
    boxes = boxes_of(rotation, np.array([np.zeros(3), far, shift]), np.ones((3, 3)))
    # Parts 0 and 2 both sit on part 1, which is far away.
    robot = Robot((CORE, Part("FixedBrick", 0, 0, 0, 0, GREY), CORE))
    assert bool(intersecting_parts(boxes, robot, OVERLAP)) is overlap
    assert bool(intersecting_parts(boxes, robot, CONTACT)) is contact


# --- oracles -----------------------------------------------------------------


@pytest.mark.parametrize("seed", range(60))
def test_a_linear_programme_agrees_whether_random_boxes_meet(seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes = boxes_of(
        np.stack([turned(rng), turned(rng)]),
        rng.uniform(-0.6, 0.6, (2, 3)),
        rng.uniform(0.1, 1.0, (2, 3)),
    )
    apart = separation(boxes, np.array([0]), np.array([1]))[0]
    shared = shared_depth(boxes)
    assert abs(shared) > 1e-9, "a seed too close to call"
    assert (apart < 0) == (shared > 0)
    # Shrinking both by half of the depth always parts them, never sooner than it.
    if apart < 0:
        assert shared <= -apart / 2 + 1e-9


@pytest.mark.parametrize("seed", range(20))
def test_depth_is_the_shortest_separating_distance(seed: int) -> None:
    # Moved by its depth along some direction the second box is free; sampled
    # directions never free it with less.
    rng = np.random.default_rng(1000 + seed)
    rotation = np.stack([turned(rng), turned(rng)])
    size = rng.uniform(0.2, 1.0, (2, 3))
    centre = rng.uniform(-0.2, 0.2, (2, 3))
    depth = -separation(boxes_of(rotation, centre, size), *_zero_one())[0]
    if depth <= 0:
        pytest.skip("apart")
    ways = rng.normal(size=(200, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    for way in ways:
        moved = centre + np.array([np.zeros(3), way * depth * 0.999])
        assert separation(boxes_of(rotation, moved, size), *_zero_one())[0] < 0


def _zero_one() -> tuple[np.ndarray, np.ndarray]:
    return np.array([0]), np.array([1])


@pytest.mark.parametrize("mode", ["overlap", "contact"])
def test_intersections_equal_those_of_all_pairs_one_by_one(
    mode: str, body_of: Callable[[int, int], Robot]
) -> None:
    vetting = OVERLAP if mode == "overlap" else CONTACT
    bound = 1e-6 if mode == "contact" else -1e-6
    hits = 0
    for seed in range(30):
        robot = body_of(seed, 16)
        boxes = place_boxes(robot, BUILT_IN)
        expected = set()
        owners = [p for p, count in enumerate(boxes.count) for _ in range(count)]
        for one, lesser in enumerate(owners):
            for other in range(one + 1, len(owners)):
                greater = owners[other]
                if lesser == greater or robot.parts[greater].parent == lesser:
                    continue
                gap = separation(boxes, np.array([one]), np.array([other]))[0]
                if gap <= bound:
                    expected.add((lesser, greater))
        assert intersecting_parts(boxes, robot, vetting) == tuple(sorted(expected))
        hits += bool(expected)
    assert 5 < hits < 28
