"""What goes into a Rerun recording, and how: the one file that logs.

A robot is one entity with its boxes as instances; geometry comes with the birth,
poses as batches of columns, a ``Clear`` at the death. Times are whole nanoseconds.
All of it is logged from one thread, for the current time is a thread's own.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import numpy.typing as npt
import rerun as rr

from analysis.viewer.body import BoxModel, Float32s
from analysis.viewer.entities import FamilyTree, PoseBatch, TimePoint, island_path
from analysis.viewer.ground import Surface
from analysis.viewer.scene import Scene
from schema.errors import RevolveError
from schema.robot.ids import BirthId

APPLICATION = "revolve"
SIMULATED = "sim_time"
BIRTHS = "births"

_ALIVE = (70, 160, 90)
_DEAD = (150, 150, 155)
_WALL = (190, 190, 195)
_LINES = ((40, 110, 190), (225, 120, 40))
_HUES = (
    (0, 114, 178), (230, 159, 0), (0, 158, 115), (204, 121, 167),
    (213, 94, 0), (86, 180, 233), (240, 228, 66), (150, 150, 150),
)  # fmt: skip
"""Of islands side by side. Source: Okabe and Ito, 2008."""
_MEMORY = "512MiB"


class ViewerError(RevolveError):
    """The viewer cannot be opened, or there is nothing to show."""


class Recording:
    """An open recording, to a file or a server or both; use it in a ``with``."""

    def __init__(
        self,
        name: str,
        blueprint: rr.blueprint.Blueprint,
        *,
        file: Path | None = None,
        serve: tuple[str, int] | None = None,
    ) -> None:
        """Open it.

        Args:
            name: of the recording; only letters, digits and ``_-.`` of it count.
            blueprint: how it is to be shown.
            file: to write to.
            serve: host and port for viewers to come to; it never waits for them.

        Raises:
            ViewerError: the file cannot be written, or nothing served there.
        """
        kept = "".join(c if c.isalnum() or c in "_-" else "-" for c in name)
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
            raise ViewerError(f"nothing can be recorded: {error}") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Write what waits, and the file's end."""
        self._stream.flush()
        self._stream.disconnect()

    def flush(self) -> None:
        """Bring what was logged to the file."""
        self._stream.flush()

    # --- arenas and robots --------------------------------------------------

    def add_scene(self, scene: Scene) -> None:
        """Tell of all islands of a run, before anything happens there."""
        is_alone = len(scene.islands) == 1
        grounds = zip(scene.islands, scene.walls, scene.surfaces, strict=True)
        for island, walls, surfaces in grounds:
            self._island(island, walls, is_alone=is_alone)
            # Off-line populations hang side by side: no ground is below them.
            if island in scene.arenas:
                self.ground(island_path(island), surfaces)

    def _island(
        self,
        island: int,
        walls: Sequence[tuple[Float32s, Float32s]],
        *,
        is_alone: bool,
    ) -> None:
        """Tell which way is up on an island, and what stands around it.

        Args:
            island: its number.
            walls: centre, attitude (7,) and half sizes (3,) of each.
            is_alone: there is no other one whose curves stand beside its.
        """
        path = island_path(island)
        self.upright(path)
        hue = _HUES[island % len(_HUES)]
        pale = tuple((each + 255) // 2 for each in hue)
        own = "" if is_alone else f"{island}: "
        fitness = rr.SeriesLines(
            names=[f"{own}mean", f"{own}best"],
            colors=_LINES if is_alone else (hue, pale),
        )
        size = rr.SeriesLines(names=f"{own}alive", colors=_ALIVE if is_alone else hue)
        self._stream.log(f"{path}/fitness", fitness, static=True)
        self._stream.log(f"{path}/size", size, static=True)
        if walls:
            places = np.array([place for place, _ in walls])
            self._stream.log(
                f"{path}/wall",
                rr.Boxes3D(
                    centers=places[:, :3],
                    quaternions=places[:, 3:],
                    half_sizes=np.array([half for _, half in walls]),
                    colors=_WALL,
                ),
                static=True,
            )

    def ground(self, path: str, surfaces: Sequence[Surface]) -> None:
        """Show what rises above a plane.

        Args:
            path: of the entity that it belongs to.
            surfaces: of all of it.
        """
        for number, surface in enumerate(surfaces):
            mesh = rr.Mesh3D(
                vertex_positions=surface.corners.reshape(-1, 3),
                vertex_normals=np.repeat(surface.normals, 3, axis=0),
                albedo_factor=surface.colour,
            )
            self._stream.log(f"{path}/ground/{number}", mesh, static=True)

    def born(self, path: str, box_model: BoxModel, when: TimePoint) -> None:
        """Give a robot its boxes, from a moment on."""
        self._at(when)
        boxes = rr.Boxes3D.from_fields(
            half_sizes=box_model.half_sizes, colors=box_model.colours, fill_mode="solid"
        )
        self._stream.log(path, boxes)

    def moved(self, path: str, moves: PoseBatch) -> None:
        """Add poses of a robot, all at once."""
        rows, count, _ = moves.centres.shape
        index = [rr.TimeColumn(SIMULATED, duration=_nanoseconds(moves.sim_time_s))]
        if moves.births is not None:
            index.append(rr.TimeColumn(BIRTHS, sequence=moves.births))
        columns = rr.Boxes3D.columns(
            centers=moves.centres.reshape(-1, 3),
            quaternions=moves.attitudes.reshape(-1, 4),
        )
        self._stream.send_columns(
            path,
            index,
            columns.partition([count] * rows),
        )

    def stands(self, path: str, centres: Float32s, attitudes: Float32s) -> None:
        """Put a robot where it stays, at the moment of what was logged before."""
        boxes = rr.Boxes3D.from_fields(centers=centres[0], quaternions=attitudes[0])
        self._stream.log(path, boxes)

    def died(self, path: str, when: TimePoint) -> None:
        """Let a robot vanish."""
        self._at(when)
        self._stream.log(path, rr.Clear(recursive=True))

    # --- the rest -----------------------------------------------------------

    def level(
        self, island: int, when: TimePoint, size: int, fitness: Sequence[float]
    ) -> None:
        """Add to an island's curves.

        Args:
            island: its number.
            when: the moment.
            size: how many live.
            fitness: mean and best, or nothing if nobody was judged.
        """
        self._at(when)
        path = island_path(island)
        self._stream.log(f"{path}/size", rr.Scalars(float(size)))
        if fitness:
            self._stream.log(f"{path}/fitness", rr.Scalars(list(fitness)))

    def upright(self, path: str) -> None:
        """Tell that z is up there."""
        self._stream.log(path, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)

    def said(self, text: str, when: TimePoint, level: str) -> None:
        """Add a line to the log; "INFO" of what goes on, "WARN" of ends."""
        self._at(when)
        self._stream.log("log", rr.TextLog(text, level=level))

    def ancestry(self, relatives: Iterable[FamilyTree], when: TimePoint) -> None:
        """Draw who descends from whom, anew."""
        self._at(when)
        entries = list(relatives)
        shown = {each.birth for each in entries}
        nodes = rr.GraphNodes(
            [_name(each.birth) for each in entries],
            positions=[(30.0 * each.order, 90.0 * each.rank) for each in entries],
            colors=[_ALIVE if each.is_alive else _DEAD for each in entries],
            labels=[_name(each.birth) for each in entries],
            radii=[13.0 if each.is_alive else 8.0 for each in entries],
            show_labels=False,
        )
        edges = [
            (_name(parent), _name(each.birth))
            for each in entries
            for parent in each.parents
            if parent in shown
        ]
        arrows = rr.GraphEdges(edges, graph_type="directed")
        self._stream.log("ancestry", nodes, arrows)

    def process_pool(self, text: str) -> None:
        """Tell who works, as Markdown."""
        document = rr.TextDocument(text, media_type="text/markdown")
        self._stream.log("workers", document, static=True)

    def _at(self, when: TimePoint) -> None:
        """Set the moment of what is logged next."""
        self._stream.reset_time()
        if when.sim_time_s is not None:
            time = np.timedelta64(round(when.sim_time_s * 1e9), "ns")
            self._stream.set_time(SIMULATED, duration=time)
        if when.births is not None:
            self._stream.set_time(BIRTHS, sequence=when.births)


def _nanoseconds(times_s: npt.NDArray[np.float64]) -> npt.NDArray[np.timedelta64]:
    return np.round(times_s * 1e9).astype("timedelta64[ns]")


def _name(birth: BirthId) -> str:
    return f"{birth.island}:{birth.number}"
