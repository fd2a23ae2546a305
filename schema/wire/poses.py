"""Poses of an arena's robots: as they travel, as arrays, as rows of their table."""

from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from schema.errors import MalformedMessage
from schema.robot.ids import BirthId
from schema.tables.columns import ROWS
from schema.wire.arena import Poses

_SCHEMA = ROWS["poses"]
_TYPES = {
    "islands": "<i4",
    "births": "<i8",
    "times_s": "<f8",
    "cores": "<f4",
    "joints": "<i4",
    "angles": "<f4",
}
"""Types of the numbers of ``Poses``."""
_CORE = 7
"""Numbers of a core: position and quaternion."""


class PoseArrays(NamedTuple):
    """N samples of robots' poses.

    Attributes:
        islands: (N,) islands on which the robots were born.
        births: (N,) their numbers there.
        times_s: (N,) simulated times [s].
        cores: (N, 7) positions of the cores [m] and their quaternions, core to world.
        joints: (N,) numbers of joint angles.
        angles: joint angles, sample by sample [rad].
    """

    islands: npt.NDArray[np.int32]
    births: npt.NDArray[np.int64]
    times_s: npt.NDArray[np.float64]
    cores: npt.NDArray[np.float32]
    joints: npt.NDArray[np.int32]
    angles: npt.NDArray[np.float32]

    @classmethod
    def received(cls, poses: Poses) -> Self:
        """Return the samples of a message.

        Raises:
            MalformedMessage: columns of different lengths.
        """
        try:
            columns = {
                name: np.frombuffer(getattr(poses, name), kind)
                for name, kind in _TYPES.items()
            }
            columns["cores"] = columns["cores"].reshape(-1, _CORE)
        except ValueError as error:
            raise MalformedMessage(f"poses: {error}") from None
        arrays = cls(**columns)
        rows = {len(column) for column in arrays[:-1]}
        joints = arrays.joints
        counted = int(joints.sum(dtype=np.int64)) if (joints >= 0).all() else -1
        if len(rows) > 1 or counted != len(arrays.angles):
            raise MalformedMessage("poses: columns must have one length")
        return arrays

    def message(self) -> Poses:
        """Return the samples as they travel."""
        columns: dict[str, npt.NDArray[np.generic]] = self._asdict()
        return Poses(
            **{
                name: columns[name].astype(kind).tobytes()
                for name, kind in _TYPES.items()
            }
        )

    @property
    def robots(self) -> list[BirthId]:
        """The robot of each sample."""
        pairs = zip(self.islands.tolist(), self.births.tolist(), strict=True)
        return [BirthId(*pair) for pair in pairs]

    def tracks(self, births: Sequence[BirthId]) -> npt.NDArray[np.float32]:
        """Return where the cores of some robots were at all S samples, (R, S, 2) [m].

        Each of the R robots, ascending, has a pose at each sample.
        """
        wanted = set(births)
        kept = [row for row, one in enumerate(self.robots) if one in wanted]
        names = self.births[kept], self.islands[kept]
        by_robot = self.cores[kept][np.lexsort((self.times_s[kept], *names)), :2]
        # -1 for the number of samples would be undefined without robots.
        samples = len(by_robot) // max(1, len(births))
        return by_robot.reshape(len(births), samples, 2)

    def of(self, births: Collection[BirthId]) -> Self:
        """Return the samples of some robots."""
        is_kept = np.array([robot in births for robot in self.robots], dtype=bool)
        return type(self)(
            self.islands[is_kept],
            self.births[is_kept],
            self.times_s[is_kept],
            self.cores[is_kept],
            self.joints[is_kept],
            self.angles[np.repeat(is_kept, self.joints)],
        )

    @classmethod
    def joined(cls, parts: Iterable[Self]) -> Self:
        """Return the samples of several parts of an arena, by time and robot."""
        islands, births, times_s, cores, joints, angles = (
            np.concatenate(columns) for columns in zip(*parts, strict=True)
        )
        order = np.lexsort((births, islands, times_s))
        counts, starts = joints[order], (np.cumsum(joints) - joints)[order]
        # Angle k of a sample that begins at s, and now at t, is number s - t + k.
        moved = np.repeat(starts - (np.cumsum(counts) - counts), counts)
        return cls(
            islands[order],
            births[order],
            times_s[order],
            cores[order],
            counts,
            angles[moved + np.arange(len(angles))],
        )

    @property
    def are_finite(self) -> bool:
        """No number of a core or a joint is infinite or NaN."""
        return bool(np.isfinite(self.cores).all() and np.isfinite(self.angles).all())

    def rows(self, island: int | None = None) -> pa.Table:
        """Return the rows of the poses table, without ``record``.

        Args:
            island: of the arena, so that robots from elsewhere are immigrants; None
                if all were born where they are.
        """
        here = self.islands if island is None else np.full_like(self.islands, island)
        ends = np.concatenate([[0], np.cumsum(self.joints)]).astype(np.int32)
        columns = [
            here,
            pa.array(self.islands, mask=self.islands == here),
            self.births,
            self.times_s,
            *self.cores.T,
            pa.ListArray.from_arrays(
                pa.array(ends), pa.array(self.angles), type=_SCHEMA.field("angles").type
            ),
        ]
        return pa.Table.from_arrays(columns, schema=_SCHEMA)
