"""Figures as files."""

from pathlib import Path

import pyarrow as pa

from analysis.figures import progression_figure, save


def test_progression_is_drawn_with_both_experiments(tmp_path: Path) -> None:
    table = pa.table(
        {
            "experiment": ["a", "a", "b", "b"],
            "births": [15, 30, 15, 30],
            "mean": [0.1, 0.2, 0.1, 0.1],
            "low": [0.05, 0.1, 0.1, 0.1],
            "high": [0.2, 0.3, 0.1, 0.1],
        }
    )
    save(progression_figure(table), tmp_path / "figure")
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "figure.pdf").read_bytes().startswith(b"%PDF")
