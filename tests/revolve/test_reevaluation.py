"""``revolve robustness`` and ``ablate`` against evaluations of the robots here."""

import re
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from msgspec.structs import replace

import revolve as rv
from coordinator.evolution.generation import random_brain
from coordinator.evolution.random_streams import Purpose, stream
from revolve.cli.winners import chosen_robots
from revolve.command import main
from revolve.robot import plain
from schema.experiment.document import body_space
from schema.experiment.file import read_experiment
from schema.experiment.identity import Identity, Origin
from schema.experiment.settings import (
    EvaluationSettings,
    evaluation_settings_of,
    lasting,
)
from schema.robot.ids import BirthId
from schema.tables.files import read_table
from tests.own_brains import write_module
from worker.filters.channels import all_ablations
from worker.robot.evaluation import evaluate
from worker.robot.robustness import all_changes

pytestmark = pytest.mark.system

SHORT = """
name = "short"
births = 4
[selection]
population = 2
children = 2
parents = "random"
[simulation]
window_steps = 80
brain_steps = 20
pose_steps = 20
evaluation_s = [0.4, 1.0]
actuator_noise = 0.1
[robust]
draws = 2
"""


def test_table_has_the_fitness_of_each_robot_under_each_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("short.toml").write_text(SHORT)
    words = ["run", "short.toml", "--seed", "3", "--in-process", "--quiet"]
    assert main([*words, "--out", "a"]) == 0
    capsys.readouterr()
    Path("out").mkdir()
    Path("out/robustness.parquet").touch()
    assert main(["robustness", "a", "--workers", "1", "--out", "out"]) == 0
    first, second, *_ = capsys.readouterr().out.splitlines()
    assert re.match(
        r"out/robustness\.parquet: replaces the table of .* UTC, its runs and its "
        r"figure; to keep them, give another folder: --out$",
        first,
    )
    assert second.startswith("a: the best ever, 0:")
    rows = pq.read_table("out/robustness.parquet").to_pylist()
    assert Path("out/robustness.png").stat().st_size > 10_000
    run = rv.Run("a")
    changes = all_changes(settings_of(0))
    names = {(row["island"], row["birth"]) for row in rows}
    assert len(rows) == len(names) * len(changes)
    assert sum(row["is_last"] for row in rows) == 2 * len(changes)
    assert len({row["birth"] for row in rows if row["is_best"]}) == 1
    (best,) = {row["birth"] for row in rows if row["is_best"]}
    assert run.best()[0] == run.robot(best)
    for row in rows:
        robot = plain(run.robot(row["birth"]))
        is_later = row["group"] == "later window"
        if not is_later and row["change"] not in ("friction 0.9", "sensor noise 0.05"):
            continue
        settings = replace(settings_of(row["birth"]), robust=None)
        changed_to = {each.name: each.settings for each in all_changes(settings)}
        own = identity(row["birth"])
        assert row["undisturbed"] == evaluate(robot, settings, own).fitness
        changed = changed_to[row["change"]]
        assert row["fitness"] == evaluate(robot, changed, own).fitness

    _check_ablations(capsys, run)
    (Path("a") / "state").write_text("running")
    for command in ("robustness", "ablate"):
        assert main([command, "a"]) == 2
        assert "'revolve resume a' finishes it" in capsys.readouterr().err


def settings_of(birth: int) -> EvaluationSettings:
    """Return the settings of the run's evaluation, with its own length."""
    settings = evaluation_settings_of(read_experiment("short.toml"))
    rows = read_table(Path("a"), "evaluations").to_pylist()
    (simulated_s,) = [row["simulated_s"] for row in rows if row["birth"] == birth]
    return lasting(settings, round(simulated_s / settings.simulation.timestep_s))


def identity(birth: int) -> Identity:
    """Return the identity of the run's evaluation, which determines the noise."""
    return Identity(Origin(seed=3, run=0, island=0), BirthId(0, birth), 0)


def _check_ablations(capsys: pytest.CaptureFixture[str], run: rv.Run) -> None:
    """Check what ``ablate`` writes, with ``[robust]``, as the run evaluates."""
    words = ["ablate", "a", "--robots", "1", "--brains", "2", "--workers", "1"]
    assert main([*words, "--out", "out"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("a: the best ever, 0:")
    table = pq.read_table("out/ablation.parquet")
    rows = table.to_pylist()
    assert Path("out/ablation.png").stat().st_size > 10_000
    assert sum(each["is_last"] for each in rows) == len(
        [each for each in rows if each["birth"] == rows[0]["birth"]]
    )
    for birth in {each["birth"] for each in rows}:
        settings = settings_of(birth)
        robot = plain(run.robot(birth))
        own = [each for each in rows if each["birth"] == birth]
        same = identity(birth)
        # The same draws of noise and [robust] as in the run.
        assert own[0]["undisturbed"] == own[0]["recorded"]
        assert own[0]["undisturbed"] == evaluate(robot, settings, same).fitness
        changes = all_ablations(robot, body_space(settings.space))
        assert len(own) == len(changes) + 2
        for change, each in zip(changes, own, strict=False):
            assert (each["change"], each["channel"]) == (change.name, change.channel)
        chosen = len(changes) - 1
        ablated = replace(settings, ablation=changes[chosen].ablation)
        assert own[chosen]["fitness"] == evaluate(robot, ablated, same).fitness
        assert own[-1]["change"] == "random brain 2"
        rng = stream(3, 0, BirthId(0, birth), 1, Purpose.OTHER_BRAIN)
        other = random_brain(rng, robot, read_experiment("short.toml"))
        assert own[-1]["fitness"] == evaluate(other, settings, same).fitness


@pytest.mark.parametrize(
    "kind",
    [
        '[brain]\ntype = "my_brains:Wave"',
        '[space]\nneuron_types = ["my_brains:Adapting"]',
        '[learning]\nlearner = "random"\nbudget = 4',
        "[selection.reevaluation]\ninterval = 2",
    ],
)
def test_robots_have_their_recorded_fitness_without_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    monkeypatch.chdir(tmp_path)
    write_module(tmp_path)
    section, _, _ = kind.partition("\n")
    start = SHORT if section in SHORT else f"{SHORT}{section}\n"
    Path("own.toml").write_text(start.replace(section, kind))
    words = ["run", "own.toml", "--seed", "3", "--in-process", "--quiet"]
    assert main([*words, "--out", "a"]) == 0
    chosen = chosen_robots([Path("a")])
    assert len(chosen) >= 2
    for one in chosen:
        alone = evaluate(plain(one.robot), one.settings, one.identity)
        assert alone.fitness == one.row["recorded"]
