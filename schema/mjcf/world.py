"""The world of robots in MuJoCo: options, gravity, ground, walls, scenery.

The world frame lies in the ground: z is its normal, and x points uphill.
"""

from math import pi, tan

import mujoco
import numpy as np

from schema.experiment.document import Arena, Simulation
from schema.experiment.environment import Environment, relief
from schema.experiment.scenery import add_scenery

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
    option.gravity = environment.gravity_vector(simulation.gravity)
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


def add_ring_wall(spec: mujoco.MjSpec, arena: Arena) -> None:
    """Add a ring of straight walls about the origin, if the arena has one.

    The inner faces touch the circle of ``wall_diameter_m`` from outside; geoms are
    ``wall{k}``. Source: the original's ring of 12 segments, 0.05 m thick, 1 m high.
    """
    if not arena.wall_diameter_m:
        return
    count, half = arena.wall_segments, 0.5 * arena.wall_thickness_m
    centre = 0.5 * arena.wall_diameter_m + half
    length = (centre + half) * tan(pi / count)
    for index in range(count):
        angle = 2.0 * pi * index / count
        spec.worldbody.add_geom(
            name=f"wall{index}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=(half, length, 0.5 * arena.wall_height_m),
            pos=(
                centre * np.cos(angle),
                centre * np.sin(angle),
                0.5 * arena.wall_height_m,
            ),
            quat=(np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle)),
        )
