"""Bounding spheres and speed bounds of a robot with a wheel and sliders."""

import mujoco
import numpy as np

from schema.experiment.document import Simulation
from schema.experiment.environment import FLAT
from schema.mjcf.model import solo_spec
from schema.parts import BUILT_IN
from schema.robogen_parts import ACTIVE_WHEEL
from schema.robot.robot import Part, Robot
from schema.robot.trace import Floats
from tests.plugins.crawlers import PISTON
from worker.clusters.models import bounding_spheres

GREY = (0.5, 0.5, 0.5)
ROBOT = Robot(
    (
        Part("Core", -1, -1, -1, 0, GREY),
        Part("Piston", 0, 0, 0, 0, GREY),
        Part("ActiveHinge", 1, 1, 0, 0, GREY),
        Part("Piston", 2, 1, 1, 90, GREY),
        Part("ActiveWheel", 3, 0, 0, 0, (70.0, *GREY)),
    )
)
SPACE = {**BUILT_IN, "Piston": PISTON, "ActiveWheel": ACTIVE_WHEEL}


def surface(model: mujoco.MjModel, geom: int) -> Floats:
    """Return points on the edges of a geom, (N, 3), in its frame."""
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
        signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
        return np.asarray(signs * model.geom_size[geom])
    radius, half = model.geom_size[geom, :2]
    turn = np.linspace(0.0, 2.0 * np.pi, 48)
    rim = np.stack([radius * np.cos(turn), radius * np.sin(turn), 0 * turn + half], 1)
    return np.concatenate([rim, rim * (1.0, 1.0, -1.0)])


def test_spheres_cover_all_points_and_weights_bound_all_speeds() -> None:
    model = solo_spec(ROBOT, SPACE, Simulation(drop_m=1.0), FLAT).compile()
    data = mujoco.MjData(model)
    bounds = bounding_spheres(model)
    root = int(model.jnt_bodyid[0])
    rng = np.random.default_rng(5)
    slack = np.inf
    for _ in range(30):
        data.qpos[7:] = np.array([0.015, 0.7, 0.015, 9.0]) * rng.uniform(-1, 1, 4)
        data.qvel[:] = rng.normal(size=model.nv)
        mujoco.mj_forward(model, data)
        bound = float(np.abs(data.qvel) @ bounds.weights)
        for geom in range(model.ngeom):
            body = int(model.geom_bodyid[geom])
            if body < root:
                continue
            turn = data.geom_xmat[geom].reshape(3, 3)
            points = data.geom_xpos[geom] + surface(model, geom) @ turn.T
            own = bounds.bodies == body - root
            frame = data.xmat[body].reshape(3, 3)
            centres = data.xpos[body] + bounds.centres[own, :3] @ frame.T
            away = np.linalg.norm(points[:, None] - centres, axis=2)
            assert (away <= bounds.radii[own] + 1e-9).any(axis=1).all()
            jacobian = np.empty((3, model.nv))
            for point in points:
                mujoco.mj_jac(model, data, jacobian, None, point, body)
                speed = float(np.linalg.norm(jacobian @ data.qvel))
                slack = min(slack, bound - speed)
                assert speed <= bound
    # The bound is no more than a few times the greatest speed.
    assert 0.0 <= slack < 3.0
