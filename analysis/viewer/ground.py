"""Rough ground, scenery and light as triangle meshes."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from analysis.viewer.body import Float32s
from schema.experiment.document import Simulation
from schema.experiment.environment import (
    LIGHT_COLOUR,
    LIGHT_M,
    Environment,
    relief,
)
from schema.parts import Vector
from schema.robot.results import Floats

_EARTH = (0.78, 0.76, 0.72, 1.0)
_AROUND, _ACROSS = 24, 14
"""Faces of round shapes around their axis, and points from pole to pole."""
_LID: Floats = np.array([(0.0, -1.0), (1.0, -1.0), (1.0, 1.0), (0.0, 1.0)])
"""Outline of boxes and cylinders: distances from the axis, and heights."""


@dataclass(frozen=True, slots=True)
class Surface:
    """Flat triangles of one colour.

    Attributes:
        corners: (T, 3, 3) of each triangle, counter-clockwise from outside, world
            frame [m].
        colour: red, green, blue, opacity, 0 to 1.
    """

    corners: Float32s
    colour: tuple[float, ...]

    @property
    def normals(self) -> Float32s:
        """Unit normal of each triangle, (T, 3); 0 if the triangle has no area."""
        first, second, third = self.corners.transpose(1, 0, 2)
        normals: Float32s = np.cross(second - first, third - first)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        np.divide(normals, lengths, out=normals, where=lengths > 0.0)
        return normals


def surfaces(
    environment: Environment, simulation: Simulation, light: Vector | None = None
) -> tuple[Surface, ...]:
    """Return the surfaces of rough ground, scenery and the light.

    Args:
        environment: ground and scenery; objects that move are where they start.
        simulation: of the scenery's defaults.
        light: position of the light, a small ball [m].

    Raises:
        ExperimentError: the scenery is invalid.
    """
    found = []
    if environment.roughness_m:
        found.append(_rough(environment))
    if environment.scenery:
        # Imports MuJoCo, which only scenery needs.
        from schema.experiment.scenery import solids  # noqa: PLC0415

        for solid in solids(environment.scenery, simulation):
            corners = _solid(solid.shape, solid.size.tolist())
            placed = corners @ solid.rotation.T + solid.centre
            found.append(Surface(placed.astype(np.float32), solid.colour))
    if light is not None:
        ball = _solid("sphere", (LIGHT_M, 0.0, 0.0)) + light
        found.append(Surface(ball.astype(np.float32), LIGHT_COLOUR))
    return tuple(found)


def _rough(environment: Environment) -> Surface:
    shares = relief(environment)
    along = np.linspace(-environment.extent_m, environment.extent_m, len(shares))
    x, y = np.meshgrid(along, along)
    nodes = np.stack([x, y, environment.roughness_m * shares], axis=-1)
    return Surface(_triangles(nodes).astype(np.float32), _EARTH)


def _solid(shape: str, size: Sequence[float]) -> Floats:
    """Return the triangles of a shape in its own frame, (T, 3, 3) [m].

    All shapes are stretched solids of revolution about z; a box has four faces.

    Args:
        shape: as in ``schema.experiment.scenery.Solid``.
        size: as in ``schema.experiment.scenery.Solid``.
    """
    a, b, c = size
    angles = np.linspace(-0.5 * pi, 0.5 * pi, _ACROSS)
    outline: Floats = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    faces, stretch = _AROUND, (a, a, a)
    if shape == "box":
        outline, faces = _LID, 4
        stretch = (a * sqrt(2.0), b * sqrt(2.0), c)
    elif shape == "cylinder":
        outline, stretch = _LID, (a, a, b)
    elif shape == "capsule":
        # Half of the points, whose number is even, is above, half below.
        outline[:, 1] += b / a * np.sign(outline[:, 1])
    elif shape == "ellipsoid":
        stretch = (a, b, c)
    triangles: Floats = _turned(outline, faces) * stretch
    return triangles


def _turned(outline: Floats, faces: int) -> Floats:
    """Return the triangles of a solid of revolution about z.

    Args:
        outline: (K, 2) distances from the axis and heights, from below.
        faces: number of faces around the axis, the first centred on x.
    """
    reach, height = outline.T[:, :, None]
    angles = 2.0 * pi * (np.arange(faces + 1) - 0.5) / faces
    x, y = reach * np.cos(angles), reach * np.sin(angles)
    return _triangles(np.stack([x, y, height + 0.0 * x], axis=-1))


def _triangles(nodes: Floats) -> Floats:
    """Return two triangles per cell of a grid, (2 (K - 1) (L - 1), 3, 3).

    Args:
        nodes: (K, L, 3) nodes; seen from outside, columns go right and rows up.
    """
    here, right = nodes[:-1, :-1], nodes[:-1, 1:]
    above, across = nodes[1:, :-1], nodes[1:, 1:]
    first = np.stack([here, right, across], axis=2)
    second = np.stack([here, across, above], axis=2)
    return np.concatenate([first, second]).reshape(-1, 3, 3)
