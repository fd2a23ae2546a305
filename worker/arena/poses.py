"""Samples of where all robots are, as columns."""

import numpy as np
import pyarrow as pa

from schema.robot.results import Floats
from schema.tables.columns import POSES
from worker.clusters.columns import Layout

_SCHEMA = POSES.remove(0)
_AXES = ("x", "y", "z", "qw", "qx", "qy", "qz")


class Poses:
    """Samples that wait to be written as columns."""

    def __init__(self, timestep_s: float) -> None:
        """Start without samples; a step of the arena takes ``timestep_s``."""
        self._timestep_s = timestep_s
        self._samples: list[tuple[int, Layout, Floats, Floats]] = []

    def add(self, step: int, layout: Layout, state: Floats) -> None:
        """Keep a sample.

        Args:
            step: the arena's.
            layout: of its robots then.
            state: of all clusters in a row.
        """
        if len(layout.numbers):
            roots, angles = state[layout.roots], state[layout.joints]
            self._samples.append((step, layout, roots, angles))

    def columns(self) -> bytes:
        """Return all samples as an Arrow IPC stream; no bytes for no samples.

        Robots stand there by their names, as if each lived where it was born:
        whoever asked for the advance knows which arena this is.
        """
        if not self._samples:
            return b""
        layouts = [layout for _, layout, _, _ in self._samples]
        roots = np.concatenate([roots for _, _, roots, _ in self._samples])
        angles = np.concatenate([angles for _, _, _, angles in self._samples])
        times = np.concatenate(
            [
                np.full(len(layout.numbers), step * self._timestep_s)
                for step, layout, _, _ in self._samples
            ]
        )
        counts = np.concatenate([layout.joint_counts for layout in layouts])
        ends = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        numbers = roots.astype(np.float32)
        listed = _SCHEMA.field("angles").type
        batch = pa.record_batch(
            [
                np.concatenate([layout.islands for layout in layouts]),
                pa.nulls(len(times), pa.int32()),
                np.concatenate([layout.numbers for layout in layouts]),
                times,
                *(numbers[:, axis] for axis in range(len(_AXES))),
                pa.ListArray.from_arrays(
                    pa.array(ends), pa.array(angles.astype(np.float32)), type=listed
                ),
            ],
            schema=_SCHEMA,
        )
        sink = pa.BufferOutputStream()
        with pa.ipc.new_stream(sink, _SCHEMA) as writer:
            writer.write_batch(batch)
        return bytes(sink.getvalue().to_pybytes())
