"""Where in its arena a robot is born.

Source: facts of the original, section 5: uniform in radius, so denser in the
centre; a few tries for some distance to everybody else.
"""

from collections.abc import Iterable
from math import cos, dist, sin, tau

from coordinator.evolution.random_streams import BufferedRng
from schema.experiment.document import Arena

Place = tuple[float, float]
"""A point of the ground plane [m]."""


def draw_place(draws: BufferedRng, others: Iterable[Place], arena: Arena) -> Place:
    """Return a place away from all others, or the last that was tried.

    Args:
        draws: where chance comes from; two numbers for each try, the angle first.
        others: last known places of the living [m].
        arena: radius, distance and number of tries.
    """
    taken = tuple(others)
    place = (0.0, 0.0)
    for _ in range(arena.birth_place_tries):
        angle = tau * draws.number()
        radius = arena.birth_radius_m * draws.number()
        place = (radius * cos(angle), radius * sin(angle))
        if all(dist(place, other) >= arena.birth_distance_m for other in taken):
            break
    return place
