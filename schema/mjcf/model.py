"""Translation of robots and their worlds into MuJoCo models.

There is one body per rigid segment, so a robot with k joints has k + 1 bodies. At
neutral pose all body frames are parallel to the core's. The origin of the root body
is the centre of the core; that of every other body is the anchor of its joint. The
position of the free joint is therefore the position that the thesis tracks. The world
frame lies in the ground: z is its normal, and
``environment.slope_direction_deg`` points uphill.

The spec of a robot has no ground and can be attached to any number of worlds, each
time with another prefix. Names of its elements, where p is the index of the part:
bodies ``root`` and ``body{p}``, joints and actuators ``joint{p}``, free joint
``free``, geoms ``{p}/{box}``, imu sites ``{p}/imu``. docs/physics.md lists the
parameters that MuJoCo needs beyond those of the original, with their measured effect.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil, pi, tan

import mujoco
import numpy as np

from schema.experiment.document import ArenaWorld, Simulation
from schema.experiment.environment import Environment, gravity_vector, relief
from schema.experiment.scenery import add_scenery, object_count
from schema.mjcf.footing import footprint, standing_height
from schema.parts import IDENTITY, BodySpace, Joint, PartType, Sensor
from schema.robot.frames import place_parts, round_reach, shapes_of
from schema.robot.robot import Robot
from schema.robot.trace import Floats

MEMORY_BYTES = 1 << 20
"""Size of the memory arena of one robot's MjData, up to ``_USUAL_PARTS``.

A pile of 30 parts needs about 120 KB, on rough ground of 5 mm patches 270 KB, and a
chain of 29 limp hinges that lies on the ground 520 KB.
"""
_USUAL_PARTS = 30

OBJECT_BYTES = 1 << 16
"""Size of the memory arena for each movable object of scenery."""
LEVER_M = 0.1
"""Lever at which a servo moves a slider [m].

It turns rotor inertia [kg m2], damping and stiffness [N m s/rad] of the settings into
mass [kg] and [N s/m].
"""

_BELOW_M = 0.1
"""Thickness of rough ground below z = 0 [m]."""

_Segment = tuple[mujoco.MjsBody, list[float]]
"""Body, and its origin in the frame of the core [m]."""


@dataclass(frozen=True, slots=True)
class RobotSpec:
    """MjSpec of a robot.

    Attributes:
        spec: root body with a free joint, no ground; attachable.
        height: of the centre of the core if the lowest point is at z = 0 [m].
    """

    spec: mujoco.MjSpec
    height: float


def robot_spec(robot: Robot, space: BodySpace, simulation: Simulation) -> RobotSpec:
    """Return the spec of a robot with the centre of its core at the origin."""
    builder = _Builder(robot, space, simulation)
    for index in range(len(robot.parts)):
        builder.add_part(index)
    return RobotSpec(builder.spec, -builder.lowest)


Furnish = Callable[[mujoco.MjSpec], None]
"""Adds further objects to a world."""


def solo_spec(
    robot: Robot,
    space: BodySpace,
    simulation: Simulation,
    environment: Environment,
    *,
    place: tuple[float, float] = (0.0, 0.0),
    furnish: Furnish | None = None,
) -> mujoco.MjSpec:
    """Return the spec of one robot in a world, at a place in the ground plane [m].

    The robot touches the ground, or stands on the rough ground or scenery below it.

    ``simulation.drop_m`` lifts the robot and ``start_deg`` turns it; ``furnish`` adds
    further objects.

    Raises:
        ExperimentError: invalid scenery.
    """
    built = robot_spec(robot, space, simulation)
    spec, height = built.spec, built.height
    memory = _memory(spec)
    attitude = _attitude(simulation)
    if attitude is not None or not environment.is_even:
        boxes = footprint(spec.compile(), attitude)
        height = standing_height(boxes, simulation, environment, place, 0.0)
    set_options(spec, simulation, environment, is_single=True)
    add_ground(spec, simulation, environment)
    if furnish is not None:
        furnish(spec)
    objects = object_count(environment, simulation) if environment.scenery else 0
    spec.memory = memory + OBJECT_BYTES * objects
    root = spec.body("root")
    root.pos = (*place, height + simulation.drop_m)
    if attitude is not None:
        root.quat = attitude
    return spec


def _memory(robot: mujoco.MjSpec) -> int:
    """Return the size of the memory arena of a robot's MjData.

    Long robots have more contacts, and each involves more joints: memory grows with
    the square of the number of parts. Unused memory costs nothing.
    """
    parts = len({geom.name.partition("/")[0] for geom in robot.geoms})
    return MEMORY_BYTES * max(1, ceil((parts / _USUAL_PARTS) ** 2))


def _attitude(simulation: Simulation) -> Floats | None:
    """Return the quaternion of the core at the start; None if it is level."""
    if not any(simulation.start_deg):
        return None
    found = np.empty(4)
    # Capitals: about the axes of the world, one after the other.
    mujoco.mju_euler2Quat(found, np.radians(simulation.start_deg), "XYZ")
    return found


def shared_model(
    robots: Sequence[tuple[str, mujoco.MjSpec]],
    simulation: Simulation,
    environment: Environment,
    *,
    furnish: Furnish | None = None,
) -> mujoco.MjModel:
    """Return the model of several robots on one ground.

    ``robots`` has the prefix of the names and the spec from ``robot_spec`` of each;
    specs are not changed and can be reused.
    """
    spec = mujoco.MjSpec()
    set_options(spec, simulation, environment, is_single=False)
    add_ground(spec, simulation, environment)
    if furnish is not None:
        furnish(spec)
    # A pile has more contacts than its robots have alone.
    spec.memory = 2 * sum(_memory(child) for _, child in robots)
    for prefix, child in robots:
        spec.attach(child, frame=spec.worldbody.add_frame(), prefix=prefix)
    return spec.compile()


def set_options(
    spec: mujoco.MjSpec,
    simulation: Simulation,
    environment: Environment,
    *,
    is_single: bool,
) -> None:
    """Set the solver, gravity and time step; one robot needs no contact islands."""
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

    Rough ground becomes the geom ``rough``, scenery ``scenery/{k}``.
    """
    spec.worldbody.add_geom(
        name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0.0, 0.0, 1.0)
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
        name="rough", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="rough"
    )


def ring_wall(arena: ArenaWorld) -> Floats:
    """Return the boxes of a ring of straight walls about the origin, if there is one.

    They are (W, 10): centre [m], attitude w, x, y, z, and half sizes [m]. The inner
    faces touch the circle of ``wall_diameter_m`` from outside. Source: the original's
    ring of 12 segments, 0.05 m thick, 1 m high.
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


def add_walls(spec: mujoco.MjSpec, walls: Floats) -> None:
    """Add walls, as from ``ring_wall``, as geoms ``wall{k}``."""
    box = mujoco.mjtGeom.mjGEOM_BOX
    for index, wall in enumerate(walls):
        geom = spec.worldbody.add_geom(name=f"wall{index}", type=box)
        geom.pos, geom.quat, geom.size = wall[:3], wall[3:7], wall[7:]


class _Builder:
    """Builds the spec of one robot, part by part in order."""

    def __init__(self, robot: Robot, space: BodySpace, simulation: Simulation) -> None:
        self.robot = robot
        self.simulation = simulation
        self.types: list[PartType] = [space[part.kind] for part in robot.parts]
        self.shapes = shapes_of(robot, space)
        self.rotations, self.positions = place_parts(robot, self.shapes)
        self.lowest = np.inf
        self.spec = mujoco.MjSpec()
        self._set_defaults()
        root = self.spec.worldbody.add_body(name="root")
        # No alignment: the position of the joint must be the centre of the core.
        root.add_freejoint(name="free", align=0)
        # Both segments of each part.
        self.segments: list[list[_Segment]] = []
        self.root: _Segment = (root, [0.0, 0.0, 0.0])

    def _set_defaults(self) -> None:
        spec, simulation = self.spec, self.simulation
        spec.compiler.degree = False
        spec.default.geom.type = mujoco.mjtGeom.mjGEOM_BOX
        set_contacts(spec, simulation)
        joint = spec.default.joint
        joint.type = mujoco.mjtJoint.mjJNT_HINGE
        joint.limited = 1
        joint.armature = simulation.armature
        joint.damping[0] = simulation.damping

    def add_part(self, index: int) -> None:
        """Add the boxes of a part, and its joint if it has one."""
        part, shape = self.robot.parts[index], self.shapes[index]
        near = self.root
        own = 0
        if index:
            slot = self.shapes[part.parent].slots[part.parent_slot]
            near = self.segments[part.parent][slot.segment]
            own = shape.slots[part.slot].segment
        pair = [near, near]
        if shape.joint is not None:
            pair[1 - own] = self._add_joint(index, shape.joint, near, own)
        self.segments.append(pair)
        self._add_boxes(index, pair)

    def _add_joint(
        self, index: int, joint: Joint, near: _Segment, own: int
    ) -> _Segment:
        """Return the segment beyond a joint; ``own`` is the near segment's number."""
        rotation = self.rotations[index]
        anchor = self.positions[index] + rotation @ joint.anchor
        # Here and below, assignments are twice as fast as keywords.
        body = near[0].add_body()
        body.name, body.pos = f"body{index}", anchor - near[1]
        # The angle is that of segment 1 relative to segment 0, even if segment 1 is
        # nearer to the core.
        axis = rotation @ joint.axis
        made = body.add_joint()
        made.name, made.axis = f"joint{index}", axis if own == 0 else -axis
        simulation, share = self.simulation, 1.0
        if joint.kind == "continuous":
            made.limited = 0
        else:
            made.range = (-joint.limit, joint.limit)
        if joint.kind == "prismatic":
            share = LEVER_M**-2
            made.type = mujoco.mjtJoint.mjJNT_SLIDE
            made.armature = share * simulation.armature
            made.damping[0] = share * simulation.damping
        motor = self.types[index].motor
        if motor is not None:
            made.armature = share * simulation.servo_armature
            actuator = self.spec.add_actuator()
            actuator.name = actuator.target = f"joint{index}"
            actuator.trntype = mujoco.mjtTrn.mjTRN_JOINT
            actuator.forcelimited = 1
            torque = motor.max_torque * simulation.torque_factor
            actuator.forcerange = (-torque, torque)
            actuator.set_to_velocity(kv=share * simulation.servo_stiffness)
        return body, anchor.tolist()

    def _add_boxes(self, index: int, pair: list[_Segment]) -> None:
        """Add the boxes of a part to its segments, and imu sites to their boxes."""
        boxes, rotation = self.shapes[index].boxes, self.rotations[index]
        sensors = self.types[index].sensors
        imus = {s.box for s in sensors if isinstance(s, Sensor) and s.kind == "imu"}
        # Arrays, shared by the boxes, are faster than tuples; colours are float32.
        colour = np.array((*self.robot.parts[index].parameters[-3:], 1.0), np.float32)
        upright = quaternion(rotation)
        ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = rotation.tolist()
        px, py, pz = self.positions[index].tolist()
        # Plain floats: faster than arrays for a few boxes per part.
        for box in boxes:
            x, y, z = box.position
            centre = (
                px + ax * x + ay * y + az * z,
                py + bx * x + by * y + bz * z,
                pz + cx * x + cy * y + cz * z,
            )
            half = (0.5 * box.size[0], 0.5 * box.size[1], 0.5 * box.size[2])
            reach = abs(cx) * half[0] + abs(cy) * half[1] + abs(cz) * half[2]
            attitude, below = upright, reach
            if box.rotation is not IDENTITY:
                turned = rotation @ np.asarray(box.rotation)
                attitude, below = quaternion(turned), float(abs(turned[2]) @ half)
            if box.is_round:
                turned = rotation @ np.asarray(box.rotation)
                below = round_reach(turned[2].tolist(), half)
            body, origin = pair[box.segment]
            place = (
                centre[0] - origin[0],
                centre[1] - origin[1],
                centre[2] - origin[2],
            )
            geom = body.add_geom()
            geom.name = f"{index}/{box.name}"
            if box.is_round:
                geom.type = mujoco.mjtGeom.mjGEOM_CYLINDER
                half = (half[0], half[2], 0.0)
            geom.size, geom.pos, geom.quat = half, place, attitude
            geom.mass = box.mass * self.simulation.mass_factor
            geom.rgba = colour
            if box.name in imus:
                body.add_site(name=f"{index}/imu", pos=place, quat=attitude)
            self.lowest = min(self.lowest, centre[2] - below)


def quaternion(rotation: Floats) -> Floats:
    """Return the unit quaternion w, x, y, z of a rotation matrix, (3, 3)."""
    found = np.empty(4)
    mujoco.mju_mat2Quat(found, rotation.ravel())
    return found
