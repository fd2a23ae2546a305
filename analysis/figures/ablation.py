"""Figure of the fitness that robots keep without sensors and motors."""

import plotnine as p9
import pyarrow as pa

from analysis.comparison.ablation import ALL, DEAD, HELD, MEAN, ONE, RANDOM
from analysis.figures.robustness import known_shares, points_of_shares

_SENSORS = {HELD: "at 0", MEAN: "at mean"}
_MOTOR = " motor dead"
_MOST_IMPORTANT = "most important"
_ROW_IN = 0.2


def ablation(table: pa.Table) -> p9.ggplot:
    """Return the share of its fitness that each robot keeps under each change.

    Sensors are shown by kind, motors in the order of what the robot loses without
    them.

    Raises:
        NothingToDraw: no robot has a positive fitness without changes.
    """
    rows = known_shares(table)
    robot = ["folder", "island", "birth"]
    is_motor = (rows["group"] == DEAD) & (rows["scope"] == ONE)
    ordered = rows[is_motor].groupby(robot)["share"]
    rows.loc[is_motor, "place"] = ordered.rank(method="first")
    rows["label"] = [_label(row) for row in rows.to_dict("records")]
    rows = rows[rows["label"] != ""]
    labels = sorted(set(rows["label"]), key=_place)
    return points_of_shares(rows, labels, 0.9 + _ROW_IN * len(labels))


def _label(row: dict[str, object]) -> str:
    """Return the row of the figure that shows a change; empty for none."""
    group, scope, kind = (str(row[name]) for name in ("group", "scope", "kind"))
    if group == RANDOM:
        return "random brains"
    if group == DEAD and scope == ONE:
        place = int(float(str(row["place"])))
        return (_MOST_IMPORTANT if place == 1 else _ordinal(place)) + _MOTOR
    if scope == ONE:
        return ""
    if group == DEAD:
        return "all motors dead" if scope == ALL else ""
    return f"{'all sensors' if scope == ALL else kind} {_SENSORS[group]}"


def _place(label: str) -> tuple[int, int, str]:
    """Return the sort key of a row of the figure."""
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
