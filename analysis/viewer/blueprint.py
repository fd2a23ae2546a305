"""Layout of the viewer: arenas, curves, log, ancestry and workers."""

from collections.abc import Sequence

import rerun as rr
import rerun.blueprint as rrb

from analysis.viewer.entities import archive_path, island_path, motion_path, robot_path
from analysis.viewer.motion import LANES
from analysis.viewer.recording import BIRTHS, SIMULATED
from analysis.viewer.scene import Scene
from schema.robot.ids import BirthId

_SKY = (246, 247, 250)
_GRID = (205, 208, 216)


def layout(
    scene: Scene, *, follow: BirthId | None = None, motions: Sequence[BirthId] = ()
) -> rrb.Blueprint:
    """Return the layout for a run; re-simulated robots have a view of their own."""
    islands, arenas = scene.islands, scene.arenas
    views = [_island_view(scene, each, follow) for each in islands]
    if motions and not arenas:
        # Off-line motions have no births to show on the same timeline.
        return _framed(_motion(motions, is_online=False), SIMULATED)
    if motions:
        views.insert(0, _motion(motions, is_online=True))
    panels = rrb.Vertical(
        _curves("Fitness", islands, "fitness"),
        _curves("Population", islands, "size"),
        *_archives(scene),
        rrb.Tabs(
            rrb.TextLogView(name="Births, deaths, migrations", origin="/log"),
            rrb.GraphView(name="Ancestry", origin="/ancestry"),
            rrb.TextDocumentView(name="Workers", origin="/workers"),
            active_tab=1,
        ),
        row_shares=[3, 2, 3, 4] if scene.grid else [3, 2, 4],
    )
    root = rrb.Horizontal(rrb.Grid(*views), panels, column_shares=[5, 3])
    # Off-line populations have no simulated time.
    is_timed = bool(motions) or arenas >= set(islands)
    return _framed(root, SIMULATED if is_timed else BIRTHS)


def _framed(root: rrb.Horizontal | rrb.Spatial3DView, timeline: str) -> rrb.Blueprint:
    return rrb.Blueprint(
        root,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(timeline=timeline, state="collapsed"),
        auto_views=False,
    )


def _curves(name: str, islands: Sequence[int], what: str) -> rrb.TimeSeriesView:
    all_of_it = rr.TimeRange(
        start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite()
    )
    return rrb.TimeSeriesView(
        name=name,
        origin="/islands",
        contents=[f"/{island_path(each)}/{what}" for each in islands],
        axis_x=rrb.TimeAxis(view_range=all_of_it),
    )


def _archives(scene: Scene) -> list[rrb.Tabs]:
    """Return the archive maps, if the experiment has a grid; y is upwards."""
    if scene.grid is None:
        return []
    over = " by ".join(scene.grid.measures[1::-1])
    own = "" if len(scene.islands) == 1 else " of island {}"
    views = [
        rrb.Spatial2DView(
            origin=f"/{archive_path(each)}", name=f"Archive{own.format(each)}: {over}"
        )
        for each in scene.islands
    ]
    return [rrb.Tabs(*views)]


def _island_view(
    scene: Scene, island: int, follow: BirthId | None
) -> rrb.Spatial3DView:
    path = island_path(island)
    tracked = robot_path(island, follow) if follow and follow.island == island else None
    is_arena = island in scene.arenas
    return rrb.Spatial3DView(
        origin=f"/{path}",
        name=f"Arena {island}" if is_arena else f"Population of island {island}",
        contents=[f"/{path}/{what}" for what in ("robots/**", "wall", "ground/**")],
        background=_SKY,
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.5, color=_GRID),
        eye_controls=_eye(0.6 if tracked else 1.2 * scene.extent_m, tracked),
    )


def _motion(births: Sequence[BirthId], *, is_online: bool) -> rrb.Spatial3DView:
    middle = len(births) // 2 // LANES * LANES + LANES // 2
    near = 0.9 if is_online else 0.9 + 0.7 * min(len(births), LANES)
    return rrb.Spatial3DView(
        origin="/motion",
        name="Re-simulated robots",
        contents="/motion/**",
        background=_SKY,
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.1, color=_GRID),
        eye_controls=_eye(near, motion_path(births[min(middle, len(births) - 1)])),
    )


def _eye(near: float, tracked: str | None) -> rrb.EyeControls3D:
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=(0.35 * near, -near, 0.8 * near),
        look_target=(0.0, 0.0, 0.0),
        eye_up=(0.0, 0.0, 1.0),
        tracking_entity=tracked,
    )
