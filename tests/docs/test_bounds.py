"""Every number of an experiment has bounds, which the reference shows."""

import json
import re
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import pytest

from docs.settings_reference import page
from schema.errors import ExperimentError
from schema.experiment.file import experiment_from_text, read_experiment

_ROW = re.compile(r"^\| `(\w+)` \| ([^|]*number[^|]*) \|", re.MULTILINE)
_BOUNDED = re.compile(r"(whole )?number >=? \S+, <=? [^\s,)]+")
_DATA = Path(__file__).parents[1] / "data"


def test_the_reference_shows_both_bounds_of_every_number() -> None:
    rows = _ROW.findall(page())
    assert len(rows) > 100
    without = {name for name, kind in rows if "number" in _BOUNDED.sub("", kind)}
    # Its head names the bound of these.
    heads = {"ground_seed", "seed", "samples", "steps", "low", "high"}
    # The bounds of values are those of the setting.
    assert without == heads | {"values"}


@pytest.mark.parametrize(
    ("keys", "where"),
    [
        ({"simulation": {"window_steps": 9 * 10**18}}, "simulation.window_steps"),
        ({"simulation": {"timestep_s": 1e-300}}, "simulation.timestep_s"),
        ({"simulation": {"evaluation_s": [12, 1e12]}}, "simulation.evaluation_s"),
        ({"space": {"min_parts": 8 * 10**8}}, "space.min_parts"),
        ({"space": {"max_hidden": 10**7}}, "space.max_hidden"),
        ({"selection": {"population": 10**9}}, "selection.population"),
        ({"births": 10**12}, "births"),
        ({"environment": {"extent_m": 1e300}}, "environment.extent_m"),
        ({"environment": {"patch_m": 1e300}}, "environment.patch_m"),
        ({"environment": {"light": [1e300, 0, 1]}}, "environment.light"),
        ({"arena": {"light": [0, -1e9, 1]}}, "arena.light"),
        ({"arena": {"wall_segments": 10**6}}, "arena.wall_segments"),
        ({"islands": [{"count": 10**5}]}, "islands"),
        ({"simulation": {"start_deg": [0, 0, 1e9]}}, "simulation.start_deg"),
        ({"sweep": {"settings": {"births": {"low": 1, "high": 10**400}}}}, "sweep"),
    ],
)
def test_absurd_settings_are_refused_in_one_line(
    keys: dict[str, Any], where: str
) -> None:
    with pytest.raises(ExperimentError) as raised:
        read_experiment({"name": "a", **keys}, "a.toml")
    line = str(raised.value)
    assert line.startswith(f"a.toml: {where}")
    assert "<=" in line or ">=" in line
    assert "\n" not in line


@pytest.mark.parametrize(
    "path", sorted(_DATA.glob("runs-*/*.zip")), ids=lambda path: path.stem
)
def test_experiments_of_earlier_runs_are_within_the_bounds(path: Path) -> None:
    with ZipFile(path) as archive:
        names = [name for name in archive.namelist() if name.endswith("run.json")]
        assert names
        for name in names:
            experiment_from_text(json.loads(archive.read(name))["document"])
