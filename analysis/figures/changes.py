"""Figures of the fitness that robots keep under changes of body, brain or world."""

from collections.abc import Sequence
from typing import Any

import plotnine as p9
import pyarrow as pa

from analysis.comparison.ablation import ALL, DEAD, HELD, MEAN, ONE, RANDOM
from analysis.figures.forms import NothingToDraw
from analysis.figures.look import BLUE, GREY, VERMILION
from analysis.figures.style import theme_of_size
from schema.errors import counted

_LAST, _BEST = "last population", "best ever"
_MOST = 2.0
"""Greatest share that the figures show; points beyond stand at the edge."""
_SENSORS = {HELD: "at 0", MEAN: "at mean"}
_MOTOR = " motor dead"
_ROW_IN = 0.2


def robustness(table: pa.Table) -> p9.ggplot:
    """Return the share of its fitness that each robot keeps under each change.

    Raises:
        NothingToDraw: no robot has a positive fitness without changes.
    """
    rows = _known_shares(table)
    raised = rows["change"].str.contains("higher")
    rows["label"] = rows["change"].where(~raised, "start raised by < 0.2 mm")
    return _points_of_shares(rows, list(dict.fromkeys(rows["label"])), 5.2)


def ablation(table: pa.Table) -> p9.ggplot:
    """Return the share of its fitness that each robot keeps under each change.

    Sensors are shown by kind, motors in the order of what the robot loses without
    them.

    Raises:
        NothingToDraw: no robot has a positive fitness without changes.
    """
    rows = _known_shares(table)
    robot = ["folder", "island", "birth"]
    is_motor = (rows["group"] == DEAD) & (rows["scope"] == ONE)
    ordered = rows[is_motor].groupby(robot)["share"]
    rows.loc[is_motor, "place"] = ordered.rank(method="first")
    rows["label"] = [_label(row) for row in rows.to_dict("records")]
    rows = rows[rows["label"] != ""]
    labels = sorted(set(rows["label"]), key=_place)
    return _points_of_shares(rows, labels, 0.9 + _ROW_IN * len(labels))


def _label(row: dict[str, object]) -> str:
    group, scope, kind = (str(row[name]) for name in ("group", "scope", "kind"))
    if group == RANDOM:
        return "random brains"
    if group == DEAD and scope == ONE:
        place = int(float(str(row["place"])))
        return ("most important" if place == 1 else _ordinal(place)) + _MOTOR
    if scope == ONE:
        return ""
    if group == DEAD:
        return "all motors dead" if scope == ALL else ""
    return f"{'all sensors' if scope == ALL else kind} {_SENSORS[group]}"


def _place(label: str) -> tuple[int, int, str]:
    blocks = ("at 0", "at mean", "motor dead", "all motors", "random")
    block = next(number for number, text in enumerate(blocks) if text in label)
    if label.endswith(_MOTOR):
        digits = "".join(filter(str.isdigit, label))
        return block, int(digits or 1), label
    return block, int(label.startswith("all")), label


def _ordinal(number: int) -> str:
    endings = {1: "st", 2: "nd", 3: "rd"}
    is_teen = number // 10 % 10 == 1
    return f"{number}{'th' if is_teen else endings.get(number % 10, 'th')}"


def _known_shares(table: pa.Table) -> Any:  # noqa: ANN401 - pandas
    rows = table.filter(table["share"].is_valid())
    if not rows:
        raise NothingToDraw("no robot has a positive fitness without changes")
    return rows.to_pandas()


def _points_of_shares(
    rows: Any,  # noqa: ANN401 - pandas
    labels: Sequence[str],
    height_in: float,
) -> p9.ggplot:
    """Return a row of points for each label, from top to bottom, and boxes."""
    beyond = int((abs(rows["share"]) > _MOST).sum())
    at_edge = f"\n(at the edge: {counted(beyond, 'point')} beyond {_MOST:g})"
    note = at_edge if beyond else ""
    rows["share"] = rows["share"].clip(-_MOST, _MOST)
    best = rows[rows["is_best"]].assign(of=_BEST)
    last = rows[rows["is_last"]].assign(of=_LAST)
    figure = p9.ggplot(mapping=p9.aes("label", "share"))
    figure += p9.geom_hline(yintercept=1.0, colour=GREY, size=0.5)
    if not last.empty:
        figure += p9.geom_boxplot(
            data=last, outlier_alpha=0, fill="#DDEBF5", colour=GREY, size=0.4
        )
    for robots, size in ((last, 1.2), (best, 2.4)):
        figure += p9.geom_point(
            p9.aes(fill="of"),
            data=robots,
            position=p9.position_jitter(width=0.15, height=0, random_state=1),
            size=size,
            stroke=0.2,
        )
    return (
        figure
        + p9.scale_fill_manual({_LAST: BLUE, _BEST: VERMILION}, name="")
        + p9.scale_x_discrete(limits=labels[::-1])
        + p9.coord_flip()
        + p9.expand_limits(y=[0, 1])
        + p9.labs(x="", y=f"fitness divided by fitness without changes{note}")
        + theme_of_size(height_in)
    )
