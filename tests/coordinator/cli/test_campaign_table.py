"""The table at the end of a campaign, worked out by hand."""

from pathlib import Path

import pytest

from coordinator.cli.campaign_table import (
    RunOutcome,
    columns,
    outcome_of,
    show_outcomes,
)

OUTCOMES = (
    RunOutcome("a", 0.1, 60.0),
    RunOutcome("b", 0.5, 100.0),
    RunOutcome("a", 0.3, 120.0),
    RunOutcome("a", 0.2, 90.0),
    RunOutcome("b", has_failed=True),
    RunOutcome("c", has_failed=True),
)


def test_each_experiment_has_a_row() -> None:
    """0.1, 0.2, 0.3: mean 0.2, variance (0.01 + 0 + 0.01) / 2."""
    assert [*zip(*columns(OUTCOMES).values(), strict=True)] == [
        ("a", "3", "0.3000", "0.2000", "0.1000", "1 min 30 s", "0"),
        ("b", "2", "0.5000", "0.5000", "-", "1 min 40 s", "1"),
        ("c", "1", "-", "-", "-", "-", "1"),
    ]


def test_the_table_fits_80_columns_and_explains_itself(
    capsys: pytest.CaptureFixture[str],
) -> None:
    show_outcomes(OUTCOMES)
    head, *lines, note = capsys.readouterr().out.splitlines()
    assert head.split()[:3] == ["experiment", "runs", "best"]
    assert len(lines) == 3
    assert max(map(len, (head, *lines, note))) <= 80
    assert "best robot in its last population" in note


def test_points_of_a_sweep_have_their_settings(
    capsys: pytest.CaptureFixture[str],
) -> None:
    runs = [
        RunOutcome(name, 0.1, 60.0, point=point)
        for name, point in (("s-0", "a.b = 1"), ("s-1", 'a.b = 2, c = "x"'), ("d", ""))
    ]
    show_outcomes([*runs, runs[0]])
    assert capsys.readouterr().out.splitlines()[-3:] == [
        "fitness of each run's best robot in its last population",
        "s-0: a.b = 1",
        's-1: a.b = 2, c = "x"',
    ]


def test_different_fitness_functions_are_named(
    capsys: pytest.CaptureFixture[str],
) -> None:
    one, other = (
        RunOutcome(name, 0.1, 60.0, function=function)
        for name, function in (("a", "locomotion"), ("b", "goals:far"))
    )
    show_outcomes([one, one])
    assert "comparable" not in capsys.readouterr().out
    show_outcomes(iter([one, other]))
    assert capsys.readouterr().out.splitlines()[-1] == (
        "not comparable, as fitness functions differ: a locomotion, b goals:far"
    )


def test_a_folder_without_a_run_counts_as_failed(tmp_path: Path) -> None:
    expected = RunOutcome("a", has_failed=True)
    assert outcome_of(tmp_path, "a", has_failed=False) == expected
    assert outcome_of(tmp_path, "a", has_failed=True) == expected
