"""The section ``[environment]``: slope, rough ground, scenery and light."""

import re
from collections.abc import Iterator
from contextlib import suppress
from functools import cached_property, lru_cache
from math import cos, inf, radians, sin
from typing import Annotated

import numpy as np
from msgspec import Meta

from schema.errors import cut
from schema.experiment.section import (
    Angle,
    Count,
    Extent,
    Length,
    Place,
    Positive,
    Section,
    multiple_problems,
)
from schema.limits import MOST_LENGTH_M
from schema.parts import Vector
from schema.robot.trace import Floats

MOST_PATCHES = 400
"""Most patches of rough ground per axis; each robot's model holds all of them."""
TAPER = 0.2
"""Share of the extent over which rough ground descends to the plane."""
LIGHT_M = 0.03
LIGHT_COLOUR = (1.0, 0.85, 0.1, 1.0)
"""Radius [m] and colour of the ball that shows the light."""
MOST_IMPULSE = 1000.0
"""Greatest impulse of a push [N s]."""
_UNUSED = re.compile(r"\s(surfacevel|adhesion|fluidshape|fluidcoef)\s*=")
"""Attributes of geoms that MuJoCo obeys, and that scenery here has not."""

_LENGTHS = re.compile(r"\s(?:size|pos|fromto|offset)\s*=\s*[\"']([^\"']*)[\"']")


class Environment(Section, frozen=True, dict=True):
    """Ground and scenery, off-line and in arenas.

    World frames lie in the ground. On a slope gravity is tilted, and heights, walls,
    birth places and pictures are as on level ground. Rough ground is a height field
    that descends to the plane at its rim; beyond the rim is the plane.

    Attributes:
        slope_deg: rise of the ground [degrees], below 45.
        slope_direction_deg: direction uphill, from x towards y [degrees].
        roughness_m: height of the highest bump [m]; 0 is a plane.
        patch_m: distance between nodes of the height field [m].
        extent_m: half length of the height field along x and y [m], about the origin.
        ground_seed: seed of the heights.
        scenery: MJCF of static objects; a document may give the path of a file,
            relative to itself.
        light: position of the light [m]; no light if not given.
        push_impulse: horizontal impulse on the core at each push [N s], off-line; 0
            is no pushes. Directions are drawn uniformly for each evaluation.
        push_interval_s: time between pushes [s].
    """

    slope_deg: Annotated[float, Meta(ge=0, lt=45)] = 0.0
    slope_direction_deg: Angle = 0.0
    roughness_m: Length = 0.0
    patch_m: Extent = 0.1
    extent_m: Extent = 5.0
    ground_seed: Count = 1
    scenery: str = ""
    light: Place | None = None
    push_impulse: Annotated[float, Meta(ge=0, le=MOST_IMPULSE)] = 0.0
    push_interval_s: Positive = 3.0

    @cached_property
    def is_even(self) -> bool:
        """Whether the ground is a plane without scenery."""
        return not (self.roughness_m or self.scenery)

    @property
    def patches(self) -> int:
        """Number of patches from the origin to the rim."""
        return round(self.extent_m / self.patch_m)

    @cached_property
    def down(self) -> Vector:
        """Unit vector of gravity in the ground's frame."""
        slope, uphill = radians(self.slope_deg), radians(self.slope_direction_deg)
        # 0.0 minus: avoids -0.0, which would change sensor readings.
        x, y = 0.0 - sin(slope) * cos(uphill), 0.0 - sin(slope) * sin(uphill)
        return x, y, -cos(slope)


FLAT = Environment()
"""The default: an infinite plane."""


@lru_cache(maxsize=64)
def gravity_vector(environment: Environment, gravity: float) -> Vector:
    """Return the gravity vector in the ground's frame [m/s2]."""
    x, y, z = environment.down
    return 0.0 + gravity * x, 0.0 + gravity * y, gravity * z


def scenery_problem(scenery: str) -> str:
    """Return what is wrong with attributes of scenery; empty if nothing is."""
    if unused := _UNUSED.search(scenery):
        return f"<geom {unused[1]}=...> is not allowed: it has no effect here"
    for lengths in _LENGTHS.finditer(scenery):
        for word in lengths[1].split():
            # What is no finite number is refused with its element.
            with suppress(ValueError):
                if MOST_LENGTH_M < abs(float(word)) < inf:
                    named = cut(lengths[0].strip())
                    return f"{named}: lengths must be <= {MOST_LENGTH_M:g} m"
    return ""


def ground_problems(environment: Environment) -> Iterator[str]:
    """Yield what is wrong with rough ground."""
    if not environment.roughness_m:
        return
    extent_m, patch_m = environment.extent_m, environment.patch_m
    # First: the ratio may be too large for an integer.
    if 2 * extent_m / patch_m >= MOST_PATCHES + 1:
        least = 2 * extent_m / MOST_PATCHES
        rule = f"must be >= 2 environment.extent_m / {MOST_PATCHES} = {least:g}"
        yield f"environment.patch_m: {rule}, got {patch_m:g}"
        return
    key = "environment.extent_m"
    yield from multiple_problems(key, extent_m, patch_m, "environment.patch_m")


@lru_cache(maxsize=8)
def relief(environment: Environment) -> Floats:
    """Return the heights of rough ground as shares of the greatest, in [0, 1].

    They are (N, N), exact in single precision, rows along y, columns along x, both
    ascending; 0 at the rim, 1 at the highest node.
    """
    half = environment.patches
    rng = np.random.default_rng(environment.ground_seed)
    bumps = rng.random((2 * half + 1, 2 * half + 1))
    away = np.abs(np.arange(-half, half + 1))
    from_rim = half - np.maximum(away[:, None], away)
    bumps *= np.minimum(1.0, from_rim / max(1.0, TAPER * half))
    shares: Floats = (bumps / bumps.max()).astype(np.float32).astype(np.float64)
    shares.setflags(write=False)
    return shares
