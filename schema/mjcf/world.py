"""The world of robots in MuJoCo: options, gravity, ground, walls, scenery.

The world frame lies in the ground: z is its normal, and x points uphill.
"""

from math import pi, tan

import mujoco
import numpy as np

from schema.experiment.document import Arena, Simulation
from schema.experiment.environment import Environment, gravity_vector, relief
from schema.experiment.scenery import add_scenery
from schema.robot.results import Floats

_BELOW_M = 0.1
"""Thickness of rough ground below z = 0 [m]."""


def set_options(
    spec: mujoco.MjSpec,
    simulation: Simulation,
    environment: Environment,
    *,
    is_single: bool,
) -> None:
    """Set the integrator, solver, gravity and time step of a world.

    Args:
        spec: of the world.
        simulation: time step, strength of gravity and contacts.
        environment: its slope.
        is_single: the world has one robot, so contact islands are not needed.
    """
    option = spec.option
    option.timestep = simulation.timestep_s
    option.gravity = gravity_vector(environment, simulation.gravity)
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.tolerance = 1e-6
    option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    # Without warm start, a step is a pure function of (qpos, qvel, ctrl). Without
    # automatic reset, divergence can be detected.
    disabled = mujoco.mjtDisableBit.mjDSBL_WARMSTART
    disabled |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    if is_single:
        disabled |= mujoco.mjtDisableBit.mjDSBL_ISLAND
    else:
        # One spec of a robot can be attached to many worlds.
        spec.copy_during_attach = True
    option.disableflags |= int(disabled)
    set_contacts(spec, simulation)


def set_contacts(spec: mujoco.MjSpec, simulation: Simulation) -> None:
    """Set the default contacts of a spec's geoms."""
    geom = spec.default.geom
    geom.condim = 3
    geom.friction = (simulation.friction, 0.0, 0.0)
    geom.solref = (simulation.contact_time_s, 1.0)


def add_ground(
    spec: mujoco.MjSpec, simulation: Simulation, environment: Environment
) -> None:
    """Add the infinite plane z = 0, named ``ground``, rough ground and scenery.

    Args:
        spec: of the world.
        simulation: default contacts of scenery.
        environment: rough ground becomes the geom ``rough``, scenery ``scenery/{k}``.

    Raises:
        ExperimentError: invalid scenery.
    """
    spec.worldbody.add_geom(
        name="ground",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=(0.0, 0.0, 1.0),
    )
    if environment.roughness_m:
        _add_relief(spec, environment)
    if environment.scenery:
        add_scenery(spec, environment.scenery, simulation)


def _add_relief(spec: mujoco.MjSpec, environment: Environment) -> None:
    shares, extent = relief(environment), environment.extent_m
    field = spec.add_hfield()
    field.name, (field.nrow, field.ncol) = "rough", shares.shape
    field.size = (extent, extent, environment.roughness_m, _BELOW_M)
    field.userdata = shares.ravel()
    spec.worldbody.add_geom(
        name="rough",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="rough",
    )


def ring_wall(arena: Arena) -> Floats:
    """Return the boxes of a ring of straight walls about the origin, if there is one.

    The inner faces touch the circle of ``wall_diameter_m`` from outside. Source: the
    original's ring of 12 segments, 0.05 m thick, 1 m high.

    Returns:
        (W, 10) centre [m], attitude w, x, y, z, and half sizes [m] of each wall.
    """
    if not arena.wall_diameter_m:
        return np.zeros((0, 10))
    count, half = arena.wall_segments, 0.5 * arena.wall_thickness_m
    centre, height = 0.5 * arena.wall_diameter_m + half, 0.5 * arena.wall_height_m
    length = (centre + half) * tan(pi / count)
    walls = []
    for index in range(count):
        angle = 2.0 * pi * index / count
        place = (centre * np.cos(angle), centre * np.sin(angle), height)
        attitude = (np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle))
        walls.append((*place, *attitude, half, length, height))
    return np.array(walls)


def add_ring_wall(spec: mujoco.MjSpec, arena: Arena) -> None:
    """Add the walls of ``ring_wall`` as geoms ``wall{k}``."""
    box = mujoco.mjtGeom.mjGEOM_BOX
    for index, wall in enumerate(ring_wall(arena)):
        geom = spec.worldbody.add_geom(name=f"wall{index}", type=box)
        geom.pos, geom.quat, geom.size = wall[:3], wall[3:7], wall[7:]
