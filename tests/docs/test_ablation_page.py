"""docs/ablation.md agrees with its rows; its summary by hand."""

from typing import Any

from docs.ablation_rows import DATA, summary_lines, write_page


def row(group: str, scope: str, share: float, kind: str = "") -> dict[str, Any]:
    return {"group": group, "scope": scope, "share": share, "kind": kind}


def test_tables_of_the_page_are_those_of_the_rows() -> None:
    assert list(DATA.glob("scenario1-*.parquet"))
    assert write_page(is_check=True) == 0, "run python -m docs.ablation_rows page"


def test_summary_by_hand() -> None:
    winners = {
        "a": [
            row("input at 0", "all", 0.5),
            row("input at 0", "kind", 0.5, "imu"),
            row("motor dead", "one", 0.2),
            row("motor dead", "one", 0.95),
            row("random brain", "one", 0.1),
            row("random brain", "one", 0.3),
            row("random brain", "one", 0.9),
        ],
        "b": [
            row("input at 0", "all", 0.95),
            row("motor dead", "one", 0.9),
            row("random brain", "one", 0.2),
        ],
    }
    lines = dict(
        line.strip("| ").split(" | ") for line in summary_lines({"x": winners})
        if "---" not in line
    )  # fmt: skip
    assert lines["without its imu"] == "50 % (50 to 50 %; 1)"
    assert lines["without its touch sensors"] == "–"
    assert lines["without sensors"] == "72 % (50 to 95 %; 2)"
    assert lines["without its most important motor"] == "55 % (20 to 90 %; 2)"
    assert lines["with a random brain, median of draws"] == "25 % (20 to 30 %; 2)"
    assert lines["winners that keep < 95 % without sensors"] == "1 of 2"
    assert lines["motors that carry >= 10 % of the fitness"] == "2 of 3"
