"""Builders of the report of three small runs."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from PIL import Image

from analysis.comparison.progression import progression
from analysis.figures.archive_maps import ArchiveMap, MapCell, map_figures
from analysis.figures.catalogue import DrawnFigure, Figure
from analysis.figures.family_tree import Best
from analysis.figures.figure_writer import Drawings, film
from analysis.measures.outputs import schema
from analysis.render.plan import CORE, Outline
from analysis.report.page import report
from schema.experiment.grid import Grid

NOTHING = Drawings([], [], {}, [])
RUNS: list[dict[str, Any]] = [
    {"experiment": "soft", "folder": f"soft-{n}", "run": n, "seed": 7, "births": 60,
     "state": "finished", "islands": 1, "differs": "", "function": "worker.fitness:f",
     "fitness_function": "locomotion", "failures": n, "duration_s": 60.0 + n}
    for n in range(2)
] + [
    {"experiment": "hard & <b>", "folder": "hard-0", "run": 0, "seed": 8, "births": 45,
     "state": "stopped", "islands": 1, "differs": "births: 1 instead of 2",
     "function": "", "fitness_function": "locomotion",
     "failures": None, "duration_s": None},
]  # fmt: skip


def tables() -> dict[str, pa.Table]:
    rows: dict[str, list[dict[str, Any]]] = {
        "runs": RUNS,
        "populations": [
            {"experiment": run["experiment"], "folder": run["folder"], "island": 0,
             "births": births, "fitness": 0.1 * (n + 1) * births / 30,
             "fitness_best": 0.5 * n}
            for n, run in enumerate(RUNS)
            for births in (15, 30)
        ],
        "robots": [
            {"experiment": run["experiment"], "folder": run["folder"],
             "birth_island": 0, "birth": birth, "fitness": fitness,
             "fitness_max": fitness, "births": birth + 1, "is_failed": False,
             "is_last": birth > 0, "island": 0,
             "sustained": 0.25 if run["run"] and birth == 2 else None,
             "parts": 9, "active_joints": 3, "hidden": 2}
            for run in RUNS
            for birth, fitness in enumerate((0.2, 0.1, 0.3))
        ],
        "comparison": [
            {"measure": "fitness", "a": "hard & <b>", "b": "soft", "births": 30,
             "runs_a": 2, "runs_b": 2, "mean_a": 0.2, "mean_b": 0.15,
             "difference": 0.05, "difference_low": 0.01, "difference_high": 0.09,
             "effect": 1.0, "p": 0.3, "q": 0.4, "runs_needed": 4},
            {"measure": "fitness_best", "a": "hard & <b>", "b": "soft", "births": 30,
             "runs_a": 2, "runs_b": 1, "mean_a": 0.2, "mean_b": 0.15,
             "difference": -0.05, "difference_low": -0.1, "difference_high": 0.02,
             "effect": 1.0, "p": 1.0, "q": 1.0},
            {"measure": "size_mean", "a": "hard & <b>", "b": "soft", "births": 30,
             "runs_a": 2, "runs_b": 2, "mean_a": 15.0, "mean_b": 15.0,
             "difference": 0.0, "effect": 0.0},
        ],
        "findings": [
            {"figure": "6.2", "claim": "a <b> fitter", "expected": ">", "runs_a": 2,
             "runs_b": 3, "mean_a": 0.25, "effect": -1.0, "q": 0.01,
             "verdict": "not reproduced", "why": "so"},
            {"figure": "6.3", "claim": "levels off", "expected": "<",
             "verdict": "undecided", "why": "there is no finished run"},
        ],
        "left_out": [
            {"folder": "", "what": "figure 6.1", "why": "no benchmark"},
            {"folder": "runs/x", "what": "run", "why": "broken & gone"},
        ],
    }  # fmt: skip
    found = {name: pa.Table.from_pylist(r, schema(name)) for name, r in rows.items()}
    return {**found, "progression": progression(found["populations"])}


def drawings(folder: Path) -> Drawings:
    """Return two figures and a film, which are written into a folder."""
    Image.new("RGB", (1600, 160), "red").save(folder / "one.png")
    pictures = [np.full((60, 80, 3), shade, np.uint8) for shade in (90, 200)]
    (folder / "one.gif").write_bytes(film(pictures, 0.1))
    figures = [
        DrawnFigure(
            Figure(number, f"Title {number}", "", (source,), lambda _: None, "bodies"),
            "What & why.",
            (folder / "one.pdf", folder / "one.png"),
            (folder / "one.png").read_bytes(),
        )
        for number, source in (("6.9", "outcomes"), ("A", "<a> file"))
    ]
    films = [(Best("soft", Path("soft-1"), 0, 0, 2, 0.3), folder / "one.gif")]
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5)])
    cells = [
        MapCell(at, at % 2, float(at), f"0:{at}", [Outline(corners, CORE)])
        for at in range(3)
    ]
    grid = Grid(("size <b>", "energy"), bounds=((0, 30), (0, 1)), bins=(3, 2))
    one = ArchiveMap("soft", Path("soft-1"), grid, cells, 3)
    figures += [
        DrawnFigure(figure, str(figure.caption), figures[0].files, b"")
        for figure in map_figures([one], {}, {})
    ]
    return Drawings(figures, films, {"hard & <b>": "no driver <x>"}, [])


def page(given: dict[str, pa.Table], drawn: Drawings) -> str:
    """Return the report."""
    when = datetime(2020, 1, 1, tzinfo=UTC)
    return report(given, drawn, "revolve analyze runs", when, {"numpy": "9.9"})
