"""A robot as boxes, and where they are in each of its recorded poses.

A tree of segments is rebuilt from a body as ``schema.mjcf`` does, without an engine:
at neutral pose all frames are parallel to the core's, and a joint turns all that
hangs beyond it. Boxes of one segment share one attitude wherever right angles allow,
for equal numbers take less room in a recording.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from analysis.viewer.quaternions import product, quaternion, rotated
from schema.parts import BodySpace, Box
from schema.robot.frames import place_parts, shapes_of
from schema.robot.results import Floats
from schema.robot.robot import Robot

Float32s = npt.NDArray[np.float32]

_PLATE_M = 0.002
"""What is thinner only closes gaps between parts."""


@dataclass(frozen=True, slots=True)
class BoxModel:
    """A body to draw: B boxes on S segments, the core's first.

    Attributes:
        half_sizes: (B, 3) [m].
        colours: (B, 3) red, green, blue, 0 to 255.
        segments: (B,) which one a box is fixed to.
        centres: (B, 3) in the segment's frame [m].
        attitudes: (A, 4) unit quaternions x, y, z, w in the segments' frames.
        attitude_of: (B,) a box's, an index.
        carried_by: (A,) the segment of each attitude.
        parents: (S,) whose child a segment is; -1 for the core's.
        anchors: (S, 3) of the joint to it, in the parent's frame [m].
        axes: (S, 3) of that joint; the angle is positive about it.
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


def box_model(robot: Robot, space: BodySpace, *, is_plain: bool) -> BoxModel:
    """Return a robot as boxes.

    Args:
        robot: a checked body; its brain is not looked at.
        space: its part types.
        is_plain: one box for what a part has on a segment, without thin plates.
    """
    builder = _Builder(robot, space, is_plain=is_plain)
    for index in range(len(robot.parts)):
        builder.add(index)
    return builder.done()


def place(
    box_model: BoxModel, roots: Floats, angles: Floats
) -> tuple[Float32s, Float32s]:
    """Return where a figure's boxes are.

    Args:
        box_model: the body.
        roots: (T, 7) position x, y, z [m] and attitude w, x, y, z of the core.
        angles: (T, J) of all joints, by ascending part [rad].

    Returns:
        Centres (T, B, 3) [m] and attitudes (T, B, 4) x, y, z, w, world frame.
    """
    turns = [roots[:, [4, 5, 6, 3]]]
    places = [roots[:, :3]]
    for joint, parent in enumerate(box_model.parents[1:]):
        half = 0.5 * angles[:, joint : joint + 1]
        turn = np.hstack([np.sin(half) * box_model.axes[joint + 1], np.cos(half)])
        offset = rotated(turns[parent], box_model.anchors[joint + 1])
        places.append(places[parent] + offset)
        turns.append(product(turns[parent], turn))
    turned, placed = np.stack(turns, axis=1), np.stack(places, axis=1)
    centres = placed[:, box_model.segments] + rotated(
        turned[:, box_model.segments], box_model.centres
    )
    attitudes = product(turned[:, box_model.carried_by], box_model.attitudes)
    return (
        centres.astype(np.float32),
        attitudes[:, box_model.attitude_of].astype(np.float32),
    )


def place_rows(box_model: BoxModel, rows: pa.Table) -> tuple[Float32s, Float32s]:
    """Return where a figure's boxes are, as ``place`` does, from rows of poses."""
    axes = ("x", "y", "z", "qw", "qx", "qy", "qz")
    roots = np.stack([rows[axis].to_numpy() for axis in axes], axis=1)
    angles = rows["angles"].combine_chunks().flatten().to_numpy()
    return place(
        box_model,
        roots.astype(np.float64),
        angles.astype(np.float64).reshape(len(roots), -1),
    )


def neutral_pose(
    box_model: BoxModel, spot: tuple[float, float]
) -> tuple[Float32s, Float32s]:
    """Return where boxes are of a robot in neutral pose that touches the ground.

    Args:
        box_model: the body.
        spot: of the core's centre in the ground plane, world frame [m].

    Returns:
        Centres (1, B, 3) and attitudes (1, B, 4), as ``place`` does.
    """
    root = np.array([[*spot, 0.0, 1.0, 0.0, 0.0, 0.0]])
    centres, attitudes = place(
        box_model, root, np.zeros((1, len(box_model.parents) - 1))
    )
    # Of a turned box the sum over its axes' heights reaches deepest.
    axes = np.stack(
        [rotated(attitudes.astype(np.float64), axis) for axis in np.eye(3)], axis=-1
    )
    reach = np.abs(axes[..., 2, :] * box_model.half_sizes).sum(axis=-1)
    centres[..., 2] -= (centres[..., 2] - reach).min()
    return centres, attitudes


class _Builder:
    """Gathers the boxes and segments of one robot, part by part."""

    def __init__(self, robot: Robot, space: BodySpace, *, is_plain: bool) -> None:
        self.parts = robot.parts
        self.shapes = shapes_of(robot, space)
        self.rotations, self.positions = place_parts(robot, self.shapes)
        self.is_plain = is_plain
        self.pairs: list[list[int]] = []
        self.parents = [-1]
        self.origins = [np.zeros(3)]
        self.axes = [np.zeros(3)]
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
            pair[1 - own] = len(self.parents) - 1
            self.attitudes.append((pair[1 - own], np.eye(3)))
        self.pairs.append(pair)
        for box in _plain(shape.boxes) if self.is_plain else shape.boxes:
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
        """Return a known attitude that differs by right angles, and by which."""
        for number, (owner, known) in enumerate(self.attitudes):
            quotient = known.T @ matrix
            if owner == segment and np.abs(quotient).max(axis=0).min() > 1.0 - 1e-9:
                return number, np.round(quotient)
        self.attitudes.append((segment, matrix))
        return len(self.attitudes) - 1, np.eye(3)

    def done(self) -> BoxModel:
        rows = sorted(self.rows, key=lambda row: row[:2])
        colours = np.array([row[4] for row in rows])
        origins = np.array(self.origins)
        parents = [max(parent, 0) for parent in self.parents]
        return BoxModel(
            half_sizes=np.array([row[3] for row in rows], dtype=np.float32),
            colours=np.round(255.0 * colours).astype(np.uint8),
            segments=np.array([row[0] for row in rows], dtype=np.intp),
            centres=np.array([row[2] for row in rows]),
            attitudes=np.array([quaternion(each) for _, each in self.attitudes]),
            attitude_of=np.array([row[1] for row in rows], dtype=np.intp),
            carried_by=np.array([owner for owner, _ in self.attitudes], dtype=np.intp),
            parents=tuple(self.parents),
            anchors=origins - origins[parents],
            axes=np.array(self.axes),
        )


def _plain(boxes: Iterable[Box]) -> list[Box]:
    """Return one box for those of a segment; plates only where nothing else is."""
    found: list[Box] = []
    for segment in (0, 1):
        own = [box for box in boxes if box.segment == segment]
        thick = [box for box in own if box.size[0] >= _PLATE_M]
        chosen = thick or own[:1]
        if chosen:
            halves = [0.5 * np.asarray(box.size) for box in chosen]
            middles = [np.asarray(box.position) for box in chosen]
            pairs = list(zip(middles, halves, strict=True))
            low = np.min([middle - half for middle, half in pairs], axis=0)
            high = np.max([middle + half for middle, half in pairs], axis=0)
            size, middle = (high - low).tolist(), (0.5 * (low + high)).tolist()
            found.append(
                Box("all", tuple(size), tuple(middle), 0.0, segment, chosen[0].rotation)
            )
    return found
