"""How the viewer is laid out: arenas side by side, curves, log, ancestry, workers."""

from collections.abc import Sequence
from collections.abc import Set as AbstractSet

import rerun as rr
import rerun.blueprint as rrb

from analysis.viewer.entities import island_path, motion_path, robot_path
from analysis.viewer.motion import LANES
from analysis.viewer.recording import BIRTHS, SIMULATED
from schema.robot.ids import BirthId

_SKY = (246, 247, 250)
_GRID = (205, 208, 216)


def layout(
    islands: Sequence[int],
    *,
    extent_m: float,
    arenas: AbstractSet[int],
    follow: tuple[int, BirthId] | None = None,
    motions: Sequence[BirthId] = (),
) -> rrb.Blueprint:
    """Return the layout for a run.

    Args:
        islands: their numbers.
        extent_m: how far from its middle an arena or a gallery reaches [m].
        arenas: those on which robots live together, in simulated time.
        follow: island and name of the robot that the camera follows there.
        motions: robots that are shown by themselves, moving.
    """
    scenes = [
        _scene(
            each,
            f"Arena {each}" if each in arenas else f"Population of island {each}",
            extent_m,
            follow,
        )
        for each in islands
    ]
    if motions and not arenas:
        # Time alone is not the births' time: nothing else could be seen at once.
        return _framed(_motion(motions, is_online=False), SIMULATED)
    if motions:
        scenes.insert(0, _motion(motions, is_online=True))
    told = rrb.Vertical(
        _curves("Fitness", islands, "fitness"),
        _curves("Population", islands, "size"),
        rrb.Tabs(
            rrb.TextLogView(name="Births, deaths, migrations", origin="/log"),
            rrb.GraphView(name="Ancestry", origin="/ancestry"),
            rrb.TextDocumentView(name="Workers", origin="/workers"),
            active_tab=1,
        ),
        row_shares=[3, 2, 4],
    )
    whole = rrb.Horizontal(rrb.Grid(*scenes), told, column_shares=[5, 3])
    # Off-line populations change by births alone.
    is_timed = bool(motions) or arenas >= set(islands)
    return _framed(whole, SIMULATED if is_timed else BIRTHS)


def _framed(root: rrb.Horizontal | rrb.Spatial3DView, timeline: str) -> rrb.Blueprint:
    """Return a layout without panels that are not looked at."""
    return rrb.Blueprint(
        root,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(timeline=timeline, state="collapsed"),
        auto_views=False,
    )


def _curves(name: str, islands: Sequence[int], what: str) -> rrb.TimeSeriesView:
    """Return the view of one curve of each island, from its beginning to its end."""
    all_of_it = rr.TimeRange(
        start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite()
    )
    return rrb.TimeSeriesView(
        name=name,
        origin="/islands",
        contents=[f"/{island_path(each)}/{what}" for each in islands],
        axis_x=rrb.TimeAxis(view_range=all_of_it),
    )


def _scene(
    island: int, name: str, extent_m: float, follow: tuple[int, BirthId] | None
) -> rrb.Spatial3DView:
    """Return the view of one island: all of it, or one robot close by."""
    path = island_path(island)
    followed = follow is not None and follow[0] == island
    near = 0.6 if followed else 1.2 * extent_m
    return rrb.Spatial3DView(
        origin=f"/{path}",
        name=name,
        contents=[f"/{path}/{what}" for what in ("robots/**", "wall", "ground/**")],
        background=_SKY,
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.5, color=_GRID),
        eye_controls=_eye(near, robot_path(*follow) if follow and followed else None),
    )


def _motion(births: Sequence[BirthId], *, is_online: bool) -> rrb.Spatial3DView:
    """Return the view of robots that do again what they did."""
    middle = len(births) // 2 // LANES * LANES + LANES // 2
    near = 0.9 if is_online else 0.9 + 0.7 * min(len(births), LANES)
    return rrb.Spatial3DView(
        origin="/motion",
        name="Robots again",
        contents="/motion/**",
        background=_SKY,
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.1, color=_GRID),
        eye_controls=_eye(near, motion_path(births[min(middle, len(births) - 1)])),
    )


def _eye(near: float, tracked: str | None) -> rrb.EyeControls3D:
    """Return a camera that looks at the middle, or follows an entity."""
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=(0.35 * near, -near, 0.8 * near),
        look_target=(0.0, 0.0, 0.0),
        eye_up=(0.0, 0.0, 1.0),
        tracking_entity=tracked,
    )
