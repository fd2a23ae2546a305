"""The list of plug-ins, and what one evaluation costs."""

import json
import tracemalloc
from pathlib import Path

import pytest

from coordinator.__main__ import main
from coordinator.plugins.command import cost_line, evaluation_cost
from schema.experiment.document import island_experiments
from schema.experiment.file import read_experiment, shipped_experiments
from schema.experiment.settings import evaluation_settings_of
from schema.plugins import permission
from schema.robot.robot import Robot
from tests.documents import parse_experiment
from worker.robot.evaluation import evaluate


def _cost(keys: str, more: str = "") -> tuple[float, float]:
    text = f'name = "a"\n[simulation]\n{keys}\n{more}'
    return evaluation_cost(parse_experiment(text, "a.toml"))


def test_memory_is_estimated(chain: Robot) -> None:
    keys = "window_steps = 4000\nbrain_steps = 1\npose_steps = 1"
    text = f'name = "a"\n[simulation]\n{keys}\n'
    settings = evaluation_settings_of(parse_experiment(text, "a.toml"))
    evaluate(chain, settings)
    tracemalloc.start()
    try:
        evaluate(chain, settings)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    estimated = 1e6 * _cost(keys)[1]
    assert 0.4 * peak < estimated < 2.5 * peak


def test_time_follows_steps_ticks_and_draws() -> None:
    time_s, _ = _cost("window_steps = 100_000")
    # 100,000 steps and 4000 ticks of 10 microseconds.
    assert time_s == pytest.approx(1.04)
    assert _cost("window_steps = 100_000", "[robust]\ndraws = 8\n")[0] == 8 * time_s
    longest = "window_steps = 400\nevaluation_s = [2.0, 500.0]"
    assert _cost(longest)[0] == pytest.approx(1.04)
    assert _cost("window_steps = 80_000\nwarmup_steps = 20_000")[0] == time_s


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("window_steps = 1_000_000", ""),
        ("window_steps = 100_000_000", "a: one evaluation takes about 1040 s"),
        ("warmup_steps = 1_000_000_000", "a: one evaluation takes about 10400 s"),
        ("[space]\nmax_hidden = 10_000", " s of CPU time and 818 MB"),
    ],
)
def test_only_large_evaluations_are_said(keys: str, said: str) -> None:
    text = f'name = "a"\n[simulation]\n{keys}\n'
    line = cost_line(parse_experiment(text, "a.toml"))
    assert line.find(said) >= 0 if said else line == ""


@pytest.mark.parametrize("name", shipped_experiments())
def test_shipped_evaluations_are_small(name: str) -> None:
    assert not any(map(cost_line, island_experiments(read_experiment(name))))


@pytest.mark.usefixtures("_nothing_allowed")
def test_modules_inside_an_entry_point_are_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An entry point may name a package that imports what it offers."""
    package = tmp_path / "pointed_pack"
    (package / "inner").mkdir(parents=True)
    (package / "__init__.py").write_text("from .scores import far\n")
    (package / "inner" / "__init__.py").write_text("")
    text = "def {}(trace, parameters):\n    return 0.0\n"
    (package / "scores.py").write_text(text.format("far"))
    (package / "inner" / "more.py").write_text(text.format("near"))
    (package / "broken.py").write_text("1 / 0\n")
    meta = tmp_path / "pointed_pack-1.dist-info"
    meta.mkdir()
    (meta / "METADATA").write_text("Metadata-Version: 2.1\nName: pointed-pack\n")
    points = "[revolve.plugins]\nmine = pointed_pack\n"
    (meta / "entry_points.txt").write_text(points)
    monkeypatch.syspath_prepend(tmp_path)
    permission._installed_modules.cache_clear()
    try:
        assert main(["plugins", "--json"]) == 1
    finally:
        permission._installed_modules.cache_clear()
    rows = [
        (row["kind"], row["name"], row["defined"])
        for row in json.loads(capsys.readouterr().out)
        if row["name"].startswith("pointed_pack")
    ]
    (kind, name, why), *found = sorted(rows)
    assert found == [
        ("fitness", "pointed_pack.inner.more:near", "more.py:1"),
        ("fitness", "pointed_pack.scores:far", "scores.py:1"),
    ]
    assert (kind, name) == ("", "pointed_pack.broken")
    assert "ZeroDivisionError" in why
