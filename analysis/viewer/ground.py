"""Rough ground as a triangle mesh; scenery and light as shapes."""

from dataclasses import dataclass

import numpy as np

from analysis.viewer.body import Float32s
from schema.experiment.document import Simulation
from schema.experiment.environment import LIGHT_COLOUR, LIGHT_M, Environment, relief
from schema.experiment.scenery import Solid, solids
from schema.parts import Vector


@dataclass(frozen=True, slots=True)
class Relief:
    """Rough ground.

    Attributes:
        corners: (T, 3, 3) of each triangle, counter-clockwise from above, world
            frame [m].
        normals: (T, 3) unit normal of each triangle.
    """

    corners: Float32s
    normals: Float32s


Surface = Relief | Solid


def surfaces(
    environment: Environment, simulation: Simulation, light: Vector | None = None
) -> tuple[Surface, ...]:
    """Return the surfaces of rough ground, scenery and the light, a small ball.

    Objects of the scenery that move are where they start.

    Raises:
        ExperimentError: the scenery is invalid.
    """
    shown: list[Surface] = []
    if environment.roughness_m:
        shown.append(_rough(environment))
    if environment.scenery:
        shown += solids(environment.scenery, simulation)
    if light is not None:
        size = np.array([LIGHT_M, 0.0, 0.0])
        shown.append(Solid("sphere", size, np.array(light), np.eye(3), LIGHT_COLOUR))
    return tuple(shown)


def _rough(environment: Environment) -> Relief:
    """Return two triangles per cell of the grid of heights."""
    shares = relief(environment)
    along = np.linspace(-environment.extent_m, environment.extent_m, len(shares))
    x, y = np.meshgrid(along, along)
    nodes = np.stack([x, y, environment.roughness_m * shares], axis=-1)
    here, right = nodes[:-1, :-1], nodes[:-1, 1:]
    above, across = nodes[1:, :-1], nodes[1:, 1:]
    first = np.stack([here, right, across], axis=2)
    second = np.stack([here, across, above], axis=2)
    corners = np.concatenate([first, second]).reshape(-1, 3, 3)
    a, b, c = corners.transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Relief(corners.astype(np.float32), normals.astype(np.float32))
