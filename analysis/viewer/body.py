"""Box models of robots, and the places of their boxes in recorded poses.

The tree of segments is rebuilt from the body as in ``schema.mjcf``, without a model: at
the neutral pose all frames are parallel to the core's, and a joint turns everything
beyond it, or moves it. A cylinder is drawn as four boxes that are inscribed in it; in
plain models it is one box around it. Boxes of one segment share an attitude if they
differ by right angles only, because equal numbers take less room in a recording.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute
from msgspec.structs import replace

from schema.errors import MalformedMessage
from schema.mjcf.model import quaternion
from schema.parts import BodySpace, Box, Matrix
from schema.robot.frames import place_parts, shapes_of
from schema.robot.robot import Robot
from schema.robot.trace import Floats

Float32s = npt.NDArray[np.float32]

_ROUND = 4
"""Boxes that draw a cylinder: a star of 16 corners on its rim."""
_PLATE_M = 0.002
"""Thinner boxes only close gaps between parts [m]."""


@dataclass(frozen=True, slots=True)
class BoxModel:
    """B boxes on S segments, the core's segment first.

    Attributes:
        half_sizes: (B, 3) half sizes of the boxes [m].
        colours: (B, 3) red, green, blue, 0 to 255.
        segments: (B,) segment that a box is fixed to.
        centres: (B, 3) centres in the segment's frame [m].
        attitudes: (A, 4) unit quaternions x, y, z, w in the segments' frames.
        attitude_of: (B,) index of each box's attitude.
        carried_by: (A,) segment of each attitude.
        parents: (S,) parent of each segment; -1 for the core's.
        anchors: (S, 3) anchor of the joint to the parent, in the parent's frame [m].
        axes: (S, 3) axis of that joint, of positive angles or displacements.
        slides: (S,) whether that joint is a slider.
    """

    half_sizes: Float32s
    colours: npt.NDArray[np.uint8]
    segments: npt.NDArray[np.intp]
    centres: Floats
    attitudes: Floats
    attitude_of: npt.NDArray[np.intp]
    carried_by: npt.NDArray[np.intp]
    parents: tuple[int, ...]
    anchors: Floats
    axes: Floats
    slides: tuple[bool, ...]


def box_model(robot: Robot, space: BodySpace, *, is_plain: bool) -> BoxModel:
    """Return the box model of a robot.

    A plain one has one box per part and segment, without thin plates.
    """
    builder = _Builder(robot, space, is_plain=is_plain)
    for index in range(len(robot.parts)):
        builder.add(index)
    return builder.model()


def place(model: BoxModel, roots: Floats, angles: Floats) -> tuple[Float32s, Float32s]:
    """Return the places of a model's boxes.

    Args:
        model: boxes of the body.
        roots: (T, 7) position x, y, z [m] and attitude w, x, y, z of the core.
        angles: (T, J) joint angles [rad] or displacements [m], by ascending part.

    Returns:
        Centres (T, B, 3) [m] and attitudes (T, B, 4) x, y, z, w, world frame.
    """
    attitudes = [roots[:, [4, 5, 6, 3]]]
    places = [roots[:, :3]]
    for joint, parent in enumerate(model.parents[1:]):
        angle, axis = angles[:, joint : joint + 1], model.axes[joint + 1]
        anchor, half = model.anchors[joint + 1], 0.5 * angle
        if model.slides[joint + 1]:
            anchor, half = anchor + angle * axis, 0.0 * half
        rotation = np.hstack([np.sin(half) * axis, np.cos(half)])
        offset = rotated(attitudes[parent], anchor)
        places.append(places[parent] + offset)
        attitudes.append(product(attitudes[parent], rotation))
    turned, placed = np.stack(attitudes, axis=1), np.stack(places, axis=1)
    offsets = rotated(turned[:, model.segments], model.centres)
    centres = placed[:, model.segments] + offsets
    own = product(turned[:, model.carried_by], model.attitudes)[:, model.attitude_of]
    return centres.astype(np.float32), own.astype(np.float32)


def place_rows(model: BoxModel, rows: pa.Table) -> tuple[Float32s, Float32s]:
    """Return the places of a model's boxes, as ``place`` does, from rows of poses.

    Raises:
        MalformedMessage: the rows have other numbers of angles than the body has
            joints.
    """
    joints = len(model.parents) - 1
    counts = pyarrow.compute.list_value_length(rows["angles"]).to_numpy()
    if (counts != joints).any():
        raise MalformedMessage(f"poses: must have {joints} angles each", "impossible")
    return place(model, *numbers_of(rows))


def numbers_of(rows: pa.Table) -> tuple[Floats, Floats]:
    """Return the cores, (T, 7), and angles, (T, J), of a robot's rows of poses."""
    axes = ("x", "y", "z", "qw", "qx", "qy", "qz")
    roots = np.stack([rows[axis].to_numpy() for axis in axes], axis=1)
    angles = rows["angles"].combine_chunks().flatten().to_numpy()
    return roots.astype(np.float64), angles.astype(np.float64).reshape(len(roots), -1)


def neutral_pose(
    model: BoxModel, spot: tuple[float, float]
) -> tuple[Float32s, Float32s]:
    """Return ``place`` of one neutral pose that stands on the ground at a spot [m]."""
    root = np.array([[*spot, 0.0, 1.0, 0.0, 0.0, 0.0]])
    centres, attitudes = place(model, root, np.zeros((1, len(model.parents) - 1)))
    # The lowest corner of a turned box is below its centre by the sum of the heights
    # of its half axes.
    axes = np.stack(
        [rotated(attitudes.astype(np.float64), axis) for axis in np.eye(3)], axis=-1
    )
    reach = np.abs(axes[..., 2, :] * model.half_sizes).sum(axis=-1)
    centres[..., 2] -= (centres[..., 2] - reach).min()
    return centres, attitudes


class _Builder:
    """Collects the boxes and segments of one robot, part by part."""

    def __init__(self, robot: Robot, space: BodySpace, *, is_plain: bool) -> None:
        self.parts = robot.parts
        self.shapes = shapes_of(robot, space)
        self.rotations, self.positions = place_parts(robot, self.shapes)
        self.is_plain = is_plain
        self.pairs: list[list[int]] = []
        self.parents = [-1]
        self.origins = [np.zeros(3)]
        self.axes = [np.zeros(3)]
        self.slides = [False]
        # Attitudes in use: (segment, matrix).
        self.attitudes: list[tuple[int, Floats]] = [(0, np.eye(3))]
        self.rows: list[tuple[int, int, Floats, Floats, tuple[float, ...]]] = []

    def add(self, index: int) -> None:
        part, shape = self.parts[index], self.shapes[index]
        near = own = 0
        if index:
            slot = self.shapes[part.parent].slots[part.parent_slot]
            near = self.pairs[part.parent][slot.segment]
            own = shape.slots[part.slot].segment
        pair = [near, near]
        if shape.joint is not None:
            rotation = self.rotations[index]
            axis = rotation @ shape.joint.axis
            self.parents.append(near)
            self.origins.append(self.positions[index] + rotation @ shape.joint.anchor)
            self.axes.append(axis if own == 0 else -axis)
            self.slides.append(shape.joint.kind == "prismatic")
            pair[1 - own] = len(self.parents) - 1
            self.attitudes.append((pair[1 - own], np.eye(3)))
        self.pairs.append(pair)
        boxes = _plain(shape.boxes) if self.is_plain else _inscribed(shape.boxes)
        for box in boxes:
            self._add_box(index, box, pair[box.segment])

    def _add_box(self, index: int, box: Box, segment: int) -> None:
        rotation = self.rotations[index]
        centre = self.positions[index] + rotation @ box.position - self.origins[segment]
        turned = rotation @ np.asarray(box.rotation)
        number, axes = self._attitude(segment, turned)
        half = 0.5 * np.abs(axes) @ box.size
        colour = self.parts[index].parameters[-3:]
        self.rows.append((segment, number, centre, half, colour))

    def _attitude(self, segment: int, matrix: Floats) -> tuple[int, Floats]:
        """Return an attitude that differs by right angles, and this rotation."""
        for number, (owner, known) in enumerate(self.attitudes):
            quotient = known.T @ matrix
            if owner == segment and np.abs(quotient).max(axis=0).min() > 1.0 - 1e-9:
                return number, np.round(quotient)
        self.attitudes.append((segment, matrix))
        return len(self.attitudes) - 1, np.eye(3)

    def model(self) -> BoxModel:
        rows = sorted(self.rows, key=lambda row: row[:2])
        segments, attitude_of, centres, halves, colours = zip(*rows, strict=True)
        origins = np.array(self.origins)
        parents = [max(parent, 0) for parent in self.parents]
        return BoxModel(
            half_sizes=np.array(halves, dtype=np.float32),
            colours=np.round(255.0 * np.array(colours)).astype(np.uint8),
            segments=np.array(segments, dtype=np.intp),
            centres=np.array(centres),
            attitudes=np.array(
                [np.roll(quaternion(each), -1) for _, each in self.attitudes]
            ),
            attitude_of=np.array(attitude_of, dtype=np.intp),
            carried_by=np.array([owner for owner, _ in self.attitudes], dtype=np.intp),
            parents=tuple(self.parents),
            anchors=origins - origins[parents],
            axes=np.array(self.axes),
            slides=tuple(self.slides),
        )


def _inscribed(boxes: Iterable[Box]) -> list[Box]:
    """Return boxes, with four boxes in place of each cylinder."""
    inscribed: list[Box] = []
    for box in boxes:
        if not box.is_round:
            inscribed.append(box)
            continue
        diameter, _, length = box.size
        step = math.pi / _ROUND
        size = (diameter * math.cos(step / 2), diameter * math.sin(step / 2), length)
        for number in range(_ROUND):
            c, s = math.cos(number * step), math.sin(number * step)
            turn = np.array(box.rotation) @ ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))
            (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = turn.tolist()
            matrix: Matrix = ((xx, xy, xz), (yx, yy, yz), (zx, zy, zz))
            inscribed.append(replace(box, size=size, rotation=matrix, is_round=False))
    return inscribed


def _plain(boxes: Iterable[Box]) -> list[Box]:
    """Return one box per segment that encloses its boxes; plates only if alone."""
    plain: list[Box] = []
    for segment in (0, 1):
        own = [box for box in boxes if box.segment == segment]
        thick = [box for box in own if box.size[0] >= _PLATE_M]
        if chosen := thick or own[:1]:
            halves = np.array([0.5 * np.asarray(box.size) for box in chosen])
            middles = np.array([box.position for box in chosen])
            low, high = (middles - halves).min(axis=0), (middles + halves).max(axis=0)
            size, middle = (high - low).tolist(), (0.5 * (low + high)).tolist()
            plain.append(
                Box("all", tuple(size), tuple(middle), 0.0, segment, chosen[0].rotation)
            )
    return plain


def product(first: Floats, second: Floats) -> Floats:
    """Return the products of quaternions x, y, z, w, broadcast."""
    vector, scalar = first[..., :3], first[..., 3:]
    other, rest = second[..., :3], second[..., 3:]
    return np.concatenate(
        [
            scalar * other + rest * vector + np.cross(vector, other),
            scalar * rest - (vector * other).sum(axis=-1, keepdims=True),
        ],
        axis=-1,
    )


def rotated(rotations: Floats, points: Floats) -> Floats:
    """Return points rotated by quaternions x, y, z, w, broadcast."""
    vector, scalar = rotations[..., :3], rotations[..., 3:]
    across = 2.0 * np.cross(vector, points)
    return points + scalar * across + np.cross(vector, across)
