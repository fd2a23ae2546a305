"""A Rerun recording; the only module that logs to it.

A robot is one entity with its boxes as instances. Geometry is logged at the birth,
poses as batches of columns, and a ``Clear`` at the death. Times are integer
nanoseconds. Rerun keeps the current time per thread, so one thread logs everything.
"""

import os
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import rerun as rr

from analysis.render.overlay import Colour, Rod
from analysis.viewer.body import BoxModel, Float32s
from analysis.viewer.entities import (
    AncestryNode,
    TimePoint,
    archive_path,
    island_path,
)
from analysis.viewer.ground import Relief, Surface
from analysis.viewer.scene import Scene
from schema.errors import RevolveError
from schema.mjcf.model import quaternion

APPLICATION = "revolve"
SIMULATED = "sim_time"
BIRTHS = "births"

_ALIVE = (70, 160, 90)
_DEAD = (150, 150, 155)
_WALL, _WORDS = (190, 190, 195), (255, 255, 255)
_LINES = ((40, 110, 190), (225, 120, 40))
_HUES = (
    (0, 114, 178), (230, 159, 0), (0, 158, 115), (204, 121, 167),
    (213, 94, 0), (86, 180, 233), (240, 228, 66), (150, 150, 150),
)  # fmt: skip
"""Colours of islands. Source: Okabe and Ito, 2008."""
_EARTH = (0.78, 0.76, 0.72, 1.0)
_MEMORY = "512MiB"


class ViewerError(RevolveError):
    """The viewer cannot be opened, or there is nothing to show."""


class Recording(AbstractContextManager["Recording"]):
    """An open recording to a file, a server or both; a context manager."""

    def __init__(
        self,
        name: str,
        blueprint: rr.blueprint.Blueprint,
        *,
        file: Path | None = None,
        serve: tuple[str, int] | None = None,
    ) -> None:
        """Open the recording; logging never waits for viewers.

        Raises:
            ViewerError: the file cannot be written, or the port cannot be served.
        """
        kept = "".join(c if c.isalnum() or c in "_-" else "-" for c in name)
        # Off, as set for another program, it would turn all of this into nothing.
        os.environ.pop("RERUN", None)
        self._stream = rr.RecordingStream(APPLICATION, recording_id=kept)
        self._stream.set_log_time_enabled(False)
        sinks: list[rr.GrpcServerSink | rr.FileSink] = []
        if serve is not None:
            host, port = serve
            sinks.append(
                rr.GrpcServerSink(bind_ip=host, port=port, server_memory_limit=_MEMORY)
            )
        if file is not None:
            sinks.append(rr.FileSink(file))
        try:
            self._stream.set_sinks(*sinks, default_blueprint=blueprint)
        except RuntimeError as error:
            raise ViewerError(f"cannot open the recording: {error}") from None

    def __exit__(self, *_: object) -> None:
        self._stream.flush()
        self._stream.disconnect()

    def flush(self) -> None:
        """Write buffered data to the file."""
        self._stream.flush()

    def add_scene(self, scene: Scene) -> None:
        """Log the islands of a run, before any robot."""
        self._far = 0.0, scene.extent_m, 0.0
        grounds = zip(scene.islands, scene.walls, scene.surfaces, strict=True)
        for island, walls, surfaces in grounds:
            path = island_path(island)
            self.upright(path)
            self._curves(island, is_alone=len(scene.islands) == 1)
            if len(walls):
                boxes = rr.Boxes3D(
                    centers=walls[:, :3],
                    quaternions=walls[:, [4, 5, 6, 3]],
                    half_sizes=walls[:, 7:],
                    colors=_WALL,
                )
                self._stream.log(f"{path}/wall", boxes, static=True)
            # Off-line populations are shown on a grid, without ground.
            if island in scene.arenas:
                self.ground(path, surfaces)

    def _curves(self, island: int, *, is_alone: bool) -> None:
        """Log names and colours of an island's curves; it may be the only island."""
        path, hue = island_path(island), _HUES[island % len(_HUES)]
        pale = tuple((each + 255) // 2 for each in hue)
        own = "" if is_alone else f"{island}: "
        fitness = rr.SeriesLines(
            names=[f"{own}mean", f"{own}best"],
            colors=_LINES if is_alone else (hue, pale),
        )
        size = rr.SeriesLines(names=f"{own}alive", colors=_ALIVE if is_alone else hue)
        self._stream.log(f"{path}/fitness", fitness, static=True)
        self._stream.log(f"{path}/size", size, static=True)

    def ground(self, path: str, surfaces: Sequence[Surface]) -> None:
        """Log ground and scenery above the plane of an entity."""
        for number, surface in enumerate(surfaces):
            drawn = _drawn(surface)
            self._stream.log(f"{path}/ground/{number}", drawn, static=True)

    def log_boxes(self, path: str, model: BoxModel, when: TimePoint) -> None:
        """Log the boxes of a robot, from a time on."""
        self._at(when)
        boxes = rr.Boxes3D.from_fields(
            half_sizes=model.half_sizes, colors=model.colours, fill_mode="solid"
        )
        self._stream.log(path, boxes)

    def paint(self, path: str, colour: Colour, when: TimePoint) -> None:
        """Log one colour of all boxes of a robot."""
        self._at(when)
        self._stream.log(path, rr.Boxes3D.from_fields(colors=[colour]))

    def overlay(
        self, island: int, rods: Sequence[Rod], text: str, when: TimePoint
    ) -> None:
        """Log discs and lines of an arena, and a text beyond its wall."""
        path = f"{island_path(island)}/ground"
        self.remove(f"{path}/overlay", when)
        if rods:
            centres, halves, turns, radii, colours = zip(*rods, strict=True)
            cylinders = rr.Cylinders3D(
                lengths=np.multiply(2.0, halves), radii=radii, colors=colours,
                centers=centres, quaternions=np.roll(turns, -1, axis=1),
                fill_mode="solid",
            )  # fmt: skip
            self._stream.log(f"{path}/overlay", cylinders)
        words = rr.Points3D([self._far], radii=0, labels=text, colors=_WORDS)
        self._stream.log(f"{path}/text", words)

    def log_poses(
        self,
        path: str,
        times_s: npt.NDArray[np.float64],
        births: npt.NDArray[np.int64] | None,
        centres: Float32s,
        attitudes: Float32s,
    ) -> None:
        """Log poses of a robot, as ``place`` returns them, in one batch.

        Their times [s], and the births so far if known, are (T,).
        """
        rows, count, _ = centres.shape
        durations = np.round(times_s * 1e9).astype("timedelta64[ns]")
        index = [rr.TimeColumn(SIMULATED, duration=durations)]
        if births is not None:
            index.append(rr.TimeColumn(BIRTHS, sequence=births))
        columns = rr.Boxes3D.columns(
            centers=centres.reshape(-1, 3), quaternions=attitudes.reshape(-1, 4)
        )
        self._stream.send_columns(path, index, columns.partition([count] * rows))

    def log_place(self, path: str, centres: Float32s, attitudes: Float32s) -> None:
        """Log the place of a robot that does not move, at the time logged last."""
        boxes = rr.Boxes3D.from_fields(centers=centres[0], quaternions=attitudes[0])
        self._stream.log(path, boxes)

    def remove(self, path: str, when: TimePoint) -> None:
        """Remove a robot from the view."""
        self._at(when)
        self._stream.log(path, rr.Clear(recursive=True))

    def level(
        self, island: int, when: TimePoint, size: int, fitness: Sequence[float]
    ) -> None:
        """Log size, and mean and best fitness if there are, of a population."""
        self._at(when)
        path = island_path(island)
        self._stream.log(f"{path}/size", rr.Scalars(float(size)))
        if fitness:
            self._stream.log(f"{path}/fitness", rr.Scalars(list(fitness)))

    def archive(
        self, island: int, pixels: npt.NDArray[np.uint8], when: TimePoint
    ) -> None:
        """Log the archive map of an island, (H, W, 3)."""
        self._at(when)
        self._stream.log(archive_path(island), rr.Image(pixels))

    def upright(self, path: str) -> None:
        """Log that z is up for an entity."""
        self._stream.log(path, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)

    def log_line(self, text: str, when: TimePoint, level: str) -> None:
        """Add a line of level "INFO" or "WARN" to the log."""
        self._at(when)
        self._stream.log("log", rr.TextLog(text, level=level))

    def ancestry(self, entries: Sequence[AncestryNode], when: TimePoint) -> None:
        """Log the whole ancestry graph: the first entry at the left, by rank."""
        self._at(when)
        births = [each.birth for each in entries]
        shown = {one.birth for one in births}
        names = [one.birth.name for one in births]
        columns = [each.order - entries[0].order for each in entries]
        ranks = [one.rank for one in births]
        nodes = rr.GraphNodes(
            names,
            positions=np.stack([columns, ranks], axis=1) * (30.0, 90.0),
            colors=[_ALIVE if each.is_alive else _DEAD for each in entries],
            labels=names,
            radii=[13.0 if each.is_alive else 8.0 for each in entries],
            show_labels=False,
        )
        edges = [
            (parent.name, one.birth.name)
            for one in births
            for parent in one.parents
            if parent in shown
        ]
        arrows = rr.GraphEdges(edges, graph_type="directed")
        self._stream.log("ancestry", nodes, arrows)

    def process_pool(self, text: str) -> None:
        """Log the workers, as Markdown."""
        document = rr.TextDocument(text, media_type="text/markdown")
        self._stream.log("workers", document, static=True)

    def _at(self, when: TimePoint) -> None:
        self._stream.reset_time()
        if when.sim_time_s is not None:
            time = np.timedelta64(round(when.sim_time_s * 1e9), "ns")
            self._stream.set_time(SIMULATED, duration=time)
        if when.births is not None:
            self._stream.set_time(BIRTHS, sequence=when.births)


def _drawn(solid: Surface) -> rr.AsComponents:
    """Return ground or a shape of scenery; a capsule's place is its lower end."""
    if isinstance(solid, Relief):
        return rr.Mesh3D(
            vertex_positions=solid.corners.reshape(-1, 3),
            vertex_normals=np.repeat(solid.normals, 3, axis=0),
            albedo_factor=_EARTH,
        )
    a, b, _ = solid.size.tolist()
    settings: dict[str, Any] = {
        "quaternions": [np.roll(quaternion(solid.rotation), -1)],
        "colors": [np.round(255 * np.array(solid.colour)).astype(np.uint8)],
        "fill_mode": "solid",
    }
    if solid.shape == "capsule":
        end = solid.centre - b * solid.rotation[:, 2]
        return rr.Capsules3D(lengths=2 * b, radii=a, translations=end, **settings)
    settings["centers"] = [solid.centre]
    if solid.shape == "cylinder":
        return rr.Cylinders3D(lengths=2 * b, radii=a, **settings)
    if solid.shape == "box":
        return rr.Boxes3D(half_sizes=[solid.size], **settings)
    half = solid.size if solid.shape == "ellipsoid" else (a, a, a)
    return rr.Ellipsoids3D(half_sizes=[half], **settings)
