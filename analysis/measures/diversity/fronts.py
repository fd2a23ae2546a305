"""Fronts of several objectives, all maximised, and the volume that they dominate."""

import numpy as np

from analysis.measures.population_table import Numbers


def front(points: Numbers) -> Numbers:
    """Return the points that no other one dominates, (F, M) of (N, M), sorted.

    A point dominates another one if it is at least as great in each objective, and
    greater in one. Of equal points there is one.
    """
    different = np.unique(points, axis=0)
    is_kept = np.zeros(len(different), np.bool_)
    # A point comes after all points that it may dominate.
    for at in range(len(different) - 1, -1, -1):
        rivals = different[at + 1 :][is_kept[at + 1 :]]
        is_kept[at] = not (rivals >= different[at]).all(axis=1).any()
    kept: Numbers = different[is_kept]
    return kept


def hypervolume(points: Numbers) -> float:
    """Return the volume that points, (N, M), all >= 0, dominate from 0 on.

    It is cut into slices of the first objective.

    Source: Zitzler 2001, "Hypervolume metric calculation" (hypervolume by slicing
    objectives).
    """
    if points.shape[1] == 1:
        return float(points.max(initial=0.0))
    kept = front(points)
    thick: list[float] = np.diff(kept[:, 0], prepend=0.0).tolist()
    slices = (step * hypervolume(kept[at:, 1:]) for at, step in enumerate(thick))
    return sum(slices, 0.0)


def added_volume(points: Numbers, new: Numbers) -> float:
    """Return the volume that a point, (M,), dominates beyond others, (N, M)."""
    if (points >= new).all(axis=1).any():
        return 0.0
    return float(np.prod(new)) - hypervolume(np.minimum(points, new))
