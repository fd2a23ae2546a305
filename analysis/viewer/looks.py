"""Who looks like what, and whose poses are which: robots told apart by their names."""

from collections.abc import Iterator

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.viewer.body import BoxModel, box_model
from schema.parts import BodySpace
from schema.robot.ids import BirthId
from schema.robot.robot import Robot


class BoxModels:
    """The figures of a run's robots, each made when it is first asked for."""

    def __init__(self, space: BodySpace) -> None:
        """Know nobody yet, of part types that are known."""
        self._space = space
        self._bodies: dict[BirthId, Robot] = {}
        self._made: dict[BirthId, BoxModel] = {}

    def add(self, birth: BirthId, body: Robot) -> None:
        """Learn what somebody looks like; nobody changes."""
        self._bodies.setdefault(birth, body)

    def __contains__(self, birth: BirthId) -> bool:
        return birth in self._bodies

    def __getitem__(self, birth: BirthId) -> BoxModel:
        if birth not in self._made:
            body = self._bodies[birth]
            self._made[birth] = box_model(body, self._space, is_plain=True)
        return self._made[birth]


def rows_by_robot(poses: pa.Table) -> Iterator[tuple[BirthId, pa.Table]]:
    """Return each robot's rows, robots ascending, times as they came."""
    born = poses["island"]
    if "birth_island" in poses.column_names:
        born = pc.coalesce(poses["birth_island"], born)
    islands, numbers = born.to_numpy(), poses["birth"].to_numpy()
    order = np.lexsort((numbers, islands))
    poses = poses.take(order)
    islands, numbers = islands[order], numbers[order]
    is_new = (np.diff(islands) != 0) | (np.diff(numbers) != 0)
    starts = [0, *(np.flatnonzero(is_new) + 1).tolist()] if len(order) else []
    for start, end in zip(starts, [*starts[1:], len(order)], strict=True):
        birth = BirthId(int(islands[start]), int(numbers[start]))
        yield birth, poses.slice(start, end - start)
