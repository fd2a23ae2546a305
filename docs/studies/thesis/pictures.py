"""Pictures of docs/results.md, drawn from the rows of docs/data."""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from analysis.comparison.claims import TOUCHES
from analysis.figures.bench import speed
from analysis.figures.courses import over_births
from analysis.figures.findings import effects
from analysis.figures.style import in_order
from analysis.render.stage import choose_engine
from docs.studies.pages import PICTURES
from docs.studies.thesis.data import BRIDGES
from docs.studies.thesis.later import windows_figure

Tables = Mapping[str, pa.Table]

_DIGEST = "rows"
"""Key of the digest in a PNG; in a JPEG it is the comment."""
_WIDTHS = {"progression.png": 1152, "windows.png": 1152, "findings.png": 1300,
           "arena-speed.png": 900, "gaits.jpg": 1100, "ancestry.jpg": 900}  # fmt: skip
"""Width of each picture [pixels]."""
_EFFECT = [
    "figure", "topic", "expected", "a", "b", "mean_b", "verdict", "near_automatic",
    "effect", "effect_low", "effect_high",
    "margin", "difference", "difference_low", "difference_high",
]  # fmt: skip
"""Columns that the picture of the findings shows."""
_COLOURS, _QUALITY, _DPI = 256, 82, 200
_BASELINES = ("no-reproduction", "no-selection")
_TREE = "scenario1"
"""Experiment whose best robot's ancestors are shown."""
_UNIT = "m/s"
"""Unit of fitness, which is the same in all experiments."""
_FOUNDER_LEVEL = -1


def _sources(tables: Tables) -> dict[str, pa.Table]:
    """Return the rows that each picture shows."""
    progression = _whole(tables["progression"])
    fitness = progression.filter(pc.field("measure") == "fitness")
    best = _families(tables)
    found = {
        "progression.png": fitness,
        "findings.png": tables["findings"].select(_EFFECT),
        "windows.png": tables["windows"],
        "gaits.jpg": pa.concat_tables(best.values()),
        "ancestry.jpg": best[_TREE],
    }
    if tables["benchmark"].num_rows:
        found["arena-speed.png"] = tables["benchmark"]
    return found


def _whole(rows: pa.Table) -> pa.Table:
    """Return the rows of experiments of the thesis and of whole runs."""
    return rows.filter(~pc.field("experiment").isin([TOUCHES, *BRIDGES]))


def _families(tables: Tables) -> dict[str, pa.Table]:
    """Return the rows of the family of each experiment's best robot."""
    rows = _whole(tables["family"])
    found = {}
    for name in in_order(rows["experiment"].to_pylist()):
        mine = rows.filter(pc.field("experiment") == name)
        heads = mine.filter(pc.field("level") == 0)
        best = heads.sort_by([("fitness", "descending"), ("run", "ascending")])
        found[name] = mine.filter(pc.field("run") == best["run"][0])
    return found


def digests(tables: Tables) -> dict[Path, str]:
    """Return the digest that each picture should hold.

    Args:
        tables: as ``docs.studies.thesis.results.tables_of`` returns them.
    """
    return {PICTURES / name: _digest(rows) for name, rows in _sources(tables).items()}


def _digest(rows: pa.Table) -> str:
    def plain(value: bytes) -> str:
        return value.hex()

    # Not the last digits, which depend on the CPU.
    lines = [
        {key: float(f"{value:.9g}") if isinstance(value, float) else value
         for key, value in row.items()}
        for row in rows.to_pylist()
    ]  # fmt: skip
    text = json.dumps(lines, default=plain, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def digest_in(path: Path) -> str:
    """Return the digest that a picture holds, "" if there is no such picture."""
    if not path.exists():
        return ""
    with Image.open(path) as picture:
        info = picture.info
    found = info.get(_DIGEST) or info.get("comment", b"")
    return found.decode() if isinstance(found, bytes) else str(found)


def draw(tables: Tables) -> Iterator[str]:
    """Draw the pictures that are not up to date; yield the names of those drawn.

    Args:
        tables: as ``docs.studies.thesis.results.tables_of`` returns them.

    Raises:
        RevolveError: a robot cannot be rendered.
    """
    plots: dict[str, Callable[[], Figure]] = {
        "progression.png": lambda: over_births(
            {name: _whole(tables[name]) for name in ("populations", "progression")},
            "fitness",
            f"mean fitness [{_UNIT}]",
        ).draw(),
        "findings.png": lambda: effects(tables),
        "windows.png": lambda: windows_figure(tables).draw(),
        "arena-speed.png": lambda: speed(tables, "arena").draw(),
    }
    stale = {
        path.name: digest
        for path, digest in digests(tables).items()
        if digest_in(path) != digest
    }
    for name in plots.keys() & stale.keys():
        _save(plots[name](), name, stale[name])
        yield name
    robots = {"gaits.jpg", "ancestry.jpg"} & stale.keys()
    if robots:
        for name, figure in _robots(tables).items():
            if name in robots:
                _save(figure, name, stale[name])
                yield name


def _save(figure: Figure, name: str, digest: str) -> None:
    """Write a figure as a picture of a given width, with its digest."""
    content = BytesIO()
    figure.savefig(content, dpi=_DPI, facecolor="white", format="png")
    plt.close(figure)
    drawn = Image.open(content).convert("RGB")
    width = _WIDTHS[name]
    small = drawn.resize(
        (width, round(width * drawn.height / drawn.width)), Image.Resampling.LANCZOS
    )
    if name.endswith(".jpg"):
        small.save(PICTURES / name, quality=_QUALITY, comment=digest.encode())
        return
    info = PngInfo()
    info.add_text(_DIGEST, digest)
    small.quantize(_COLOURS, Image.Quantize.MAXCOVERAGE).save(
        PICTURES / name, pnginfo=info, optimize=True
    )


def _robots(tables: Tables) -> dict[str, Figure]:
    """Return the figures of gaits and of ancestors."""
    choose_engine()
    # They import MuJoCo, which needs to know the engine.
    from analysis.figures.family_tree import Best  # noqa: PLC0415
    from analysis.figures.pictures import family_tree, gaits  # noqa: PLC0415
    from analysis.figures.robot_pictures import robot_picture  # noqa: PLC0415
    from schema.experiment.document import body_space  # noqa: PLC0415
    from schema.experiment.file import experiment_from_text  # noqa: PLC0415
    from schema.experiment.identity import Origin  # noqa: PLC0415
    from schema.robot.genome import develop  # noqa: PLC0415
    from schema.robot.ids import BirthId  # noqa: PLC0415
    from schema.wire.protobuf import decode_genome  # noqa: PLC0415
    from worker.robot.evaluation import simulate  # noqa: PLC0415

    pictures, relatives = {}, {}
    for name, rows in _families(tables).items():
        run = rows["run"][0].as_py()
        details = tables["runs"].filter(
            (pc.field("experiment") == name) & (pc.field("run") == run)
        )
        experiment = experiment_from_text(details["document"][0].as_py(), is_own=True)
        types = body_space(experiment.space)
        bodies = [
            [part.gene for part in develop(decode_genome(genome), types).parts]
            for genome in rows["genome"].to_pylist()
        ]
        relatives[name] = _family(rows, bodies)
        best = Best(
            name, Path(), 0, 0, rows["birth"][0].as_py(), rows["fitness"][0].as_py()
        )
        births = pa.table(
            {
                "island": pa.array(np.zeros(rows.num_rows, np.int64)),
                "birth": rows["birth"],
                "genome": rows["genome"],
                "robot": pa.nulls(rows.num_rows, pa.binary()),
            }
        )
        pictures[name] = robot_picture(
            best,
            births,
            relatives[name],
            experiment,
            simulate,
            origin=Origin(seed=details["seed"][0].as_py(), run=run),
            has_family=name == _TREE,
        )
    mine = _families(tables)[_TREE]
    numbers = zip(mine["birth"].to_pylist(), mine["fitness"].to_pylist(), strict=True)
    fitness = {
        BirthId(0, birth): value for birth, value in numbers if value is not None
    }
    return {
        "gaits.jpg": gaits([*pictures.values()], dict.fromkeys(pictures, _UNIT)),
        "ancestry.jpg": family_tree(pictures[_TREE], relatives[_TREE], fitness, _UNIT),
    }


def _family(rows: pa.Table, genes: list[list[int]]) -> Any:  # noqa: ANN401 - see _robots
    """Return a family whose members are the rows of ``family``.

    Args:
        rows: rows of one robot's family.
        genes: genes of each row's parts.
    """
    from analysis.measures.families import Family  # noqa: PLC0415 - see _robots

    levels = [
        _FOUNDER_LEVEL if level is None else level
        for level in rows["level"].to_pylist()
    ]
    members = [
        tuple(row for row, level in enumerate(levels) if level == wanted)
        for wanted in range(max(levels) + 1)
    ]
    births = rows["birth"].to_pylist()
    row_of = {birth: row for row, birth in enumerate(births) if levels[row] >= 0}
    edges = [
        (child, row_of[parent])
        for child in row_of.values()
        for parent in rows["parents"][child].as_py()
        if parent in row_of
    ]
    inherited = {gene for member in row_of.values() for gene in genes[member] if gene}
    # Rows are in the order of a family: founders with the most parts first.
    founders = tuple(
        row
        for row, parents in enumerate(rows["parents"].to_pylist())
        if not parents and inherited & {*genes[row]}
    )
    founder_of: dict[int, int] = {}
    for founder in founders:
        for gene in filter(None, genes[founder]):
            founder_of.setdefault(gene, founder)
    return Family(tuple(members), tuple(edges), founders, founder_of)
