"""Descriptors of bodies and gaits that the field uses: built-in measures.

Bodies are trees of P parts. Distances are those of the parts' origins, joints at 0, in
the core's frame; Miras et al. place modules of equal size on a grid. For such bodies
the values are theirs.
"""

import math

import numpy as np

from schema.robot.trace import Floats, Trace, needs

PART_M = 0.041
"""Side of a brick: length that a part counts as [m]."""
STILL = 0.001
"""Root mean square of joint positions below which a robot does not move [rad or m]."""


def body_size(trace: Trace) -> float:
    """Return the number of parts, P [1].

    Source: Miras et al. 2018, "Search space analysis of evolvable robot morphologies",
    without its division by the most parts allowed.
    """
    return float(len(trace.robot.parts))


def body_limbs(trace: Trace) -> float:
    """Return the leaves of the tree, over the most that P parts can have [1].

    The core is no leaf. The most are P - 1 - max(0, (P - 3) // 3), of parts with four
    slots; parts of plug-ins with more slots can exceed it. 0 for a single core.

    Source: Miras et al. 2018, "limbs".
    """
    parts = trace.robot.parts
    leaves = len({*range(1, len(parts))} - {part.parent for part in parts})
    return leaves / max(1, len(parts) - 1 - max(0, (len(parts) - 3) // 3))


def body_joints(trace: Trace) -> float:
    """Return the parts with a motor, over all parts but the core [1].

    Joints without a motor do not count. 0 for a single core.

    Source: Miras et al. 2018, "joints", without its condition that both ends of a
    joint hold bricks; so also in ARIEL.
    """
    robot = trace.robot
    motors = sum(neuron.layer == "output" for neuron in robot.brain.neurons)
    return motors / max(1, len(robot.parts) - 1)


@needs("part_position")
def body_proportion(trace: Trace) -> float:
    """Return the shorter over the longer side of the body's box on the ground [1].

    The box is along the core's x and y axes; a side is ``PART_M`` more than the
    distance of the outermost origins. 1 is as long as wide.

    Source: Miras et al. 2018, "proportion".
    """
    length, width, _ = _box(trace)
    return min(length, width) / max(length, width)


@needs("part_position")
def body_coverage(trace: Trace) -> float:
    """Return the number of parts, over that which fills the body's box, at most 1 [1].

    The box is along the core's axes, also upwards; sides as in ``body_proportion``.
    A part fills a cube of ``PART_M``. Shorter parts can be closer than that: the value
    is cut off at 1.

    Source: Miras et al. 2018, "coverage".
    """
    length, width, height = _box(trace)
    return min(1.0, len(trace.robot.parts) / (length * width * height))


@needs("contact")
def duty_factor(trace: Trace) -> float:
    """Return the share of time in contact, of the parts that are ever in contact [1].

    The mean over the parts that touch anything but the robot in at least one sample, of
    the share of samples in which they do; 0 if there are none. ``contact_share`` is the
    mean over all parts.

    Source: duty factor of legs, as in Cully et al. 2015, "Robots that can adapt like
    animals", as one number.
    """
    shares = trace.contact.mean(axis=0)
    feet = shares[shares > 0.0]
    return float(feet.mean()) if feet.size else 0.0


@needs("joint_angle")
def periodicity(trace: Trace) -> float:
    """Return the autocorrelation of joint positions at their main period, 0 to 1 [1].

    The greatest one of lags from the first that is not positive, up to half the window;
    all joints have one period. 1 is a motion that repeats itself, 0 one that does not,
    or a robot whose joints move less than ``STILL``.

    Source: own definition.
    """
    angle = trace.joint_angle
    moved = angle - angle.mean(axis=0)
    if not moved.size or math.sqrt(float((moved * moved).mean())) < STILL:
        return 0.0
    best, has_crossed = 0.0, False
    for lag in range(1, len(moved) // 2 + 1):
        alike = _correlation(moved[:-lag], moved[lag:])
        has_crossed = has_crossed or alike <= 0.0
        best = max(best, alike) if has_crossed else best
    return best


def _correlation(first: Floats, second: Floats) -> float:
    """Return the cosine of the angle between two arrays; 0 if one of them is 0."""
    size = math.sqrt(float((first * first).sum()) * float((second * second).sum()))
    return min(1.0, float((first * second).sum()) / size) if size else 0.0


def _box(trace: Trace) -> list[float]:
    """Return length, width and height of the body in lengths of a part, each >= 1."""
    sides: list[float] = (1.0 + np.ptp(trace.part_position, axis=0) / PART_M).tolist()
    return sides
