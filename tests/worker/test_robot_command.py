"""``revolve robot simulate``: equal results from all file formats."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from schema.formats.files import settings_of, write_robot
from worker import robot_command
from worker.bench.spider import spider
from worker.robot.evaluation import evaluate
from worker.robot_command import main

Simulate = Callable[..., Any]


@pytest.fixture
def simulated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Simulate:
    """Return a function that simulates the spider by the sections of an experiment."""
    write_robot(spider(), tmp_path / "spider.yaml")
    file = tmp_path / "mine.toml"

    def run(sections: str, *flags: str) -> Any:  # noqa: ANN401 - out and err
        file.write_text(f'name = "mine"\n{sections}\n')
        words = [str(tmp_path / "spider.yaml"), "--experiment", str(file), *flags]
        assert main(["robot simulate", *words]) == 0
        return capsys.readouterr()

    return run


def test_file_has_the_evaluation_of_its_robot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    expected = evaluate(spider(), settings_of(None))
    for name in ("spider.xml", "spider.yaml", "spider.pb"):
        write_robot(spider(), tmp_path / name)
        assert main(["robot simulate", str(tmp_path / name)]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[0] == f"fitness:           {expected.fitness!r}"
        assert lines[1] == f"path velocity:     {expected.path_velocity!r} m/s"
        assert lines[3] == "simulated:         12.0 s"


def test_fitness_in_an_arena_is_told_from_that_alone(simulated: Simulate) -> None:
    for sections, is_arena in (("", False), ("[arena]", True)):
        said = simulated(sections).err
        assert ("simulated alone; in an arena" in said) is is_arena


@pytest.mark.parametrize(
    "section",
    [
        "[simulation]\nactuator_noise = 0.1",
        "[environment]\npush_impulse = 0.1",
        "[robust]\ndraws = 2",
    ],
)
def test_draws_of_a_run_are_told_from_those_alone(
    simulated: Simulate, section: str
) -> None:
    for text, is_told in (("", False), (section, True)):
        said = simulated(text).err
        assert ("use other random numbers than the run" in said) is is_told


def test_drawn_lengths_of_a_run_are_told_from_that_alone(simulated: Simulate) -> None:
    told = (
        "revolve: simulated for 2 s; the run draws the length of each evaluation "
        "(simulation.evaluation_s)\n"
    )
    for text, is_told in (("", False), ("evaluation_s = [2.0, 4.0]\n", True)):
        clock = "warmup_steps = 200\nwindow_steps = 200\n"
        shown = simulated(f"[simulation]\n{clock}{text}")
        assert "simulated:         2.0 s" in shown.out
        assert (told in shown.err) is is_told


def test_trials_have_noise_of_their_own(simulated: Simulate) -> None:
    noisy = "[simulation]\nwindow_steps = 400\nactuator_noise = 0.2"
    words = [(), ("--trial", "0"), ("--trial", "1"), ("--trial", "1", "--robustness")]
    plain, first, second, changed = (simulated(noisy, *each).out for each in words)
    assert plain == first != second
    assert changed.startswith(second)


@pytest.mark.parametrize(
    "trial", ["-1", "1.5", "x", "1000001", "", "1e3", "nan", "1,2", "0x1", "None"]
)
def test_other_trials_are_refused(
    simulated: Simulate, trial: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        simulated("", f"--trial={trial}")
    said = capsys.readouterr().err
    assert f"--trial: must be a whole number in 0..1000000, got {trial!r}" in said
    assert said.count("\n") == 1


def test_robustness_is_shown_by_change_and_in_one_line(simulated: Simulate) -> None:
    short = "[simulation]\nwindow_steps = 400"
    plain = simulated(short).out.splitlines()
    lines = simulated(short, "--robustness").out.splitlines()
    assert lines[:4] == plain
    assert len(lines) == 4 + 11 + 4 + 1
    assert lines[-2].startswith("window 8 to 10 s:")
    assert lines[4].startswith("time step 0.0025 s:")
    shares = [int(line.split("(")[1].split()[0]) for line in lines[4:-1]]
    small, later = shares[:11], shares[11:]
    text = f"keeps {min(small)} to {max(small)} % of its fitness"
    assert lines[-1].startswith(text)
    share = re.search(r"; sustains (\d+) % in the next 4 windows$", lines[-1])
    assert share
    assert int(share[1]) == pytest.approx(sum(later) / 4, abs=1)


def test_a_long_simulation_shows_its_progress(
    simulated: Simulate, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("schema.agent.progress_line.SOON_S", 0.0)
    monkeypatch.setattr("schema.agent.progress_line.SPAN_S", 0.0)
    said = simulated("[simulation]\nwarmup_steps = 0\nwindow_steps = 20000")
    *_, line = said.err.splitlines()
    found = re.fullmatch(r"simulated (\d+\.\d) of 100 s", line)
    assert found
    assert float(found[1]) > 0
    assert "simulated:         100.0 s" in said.out


def test_until_the_first_tick_the_model_is_built(
    simulated: Simulate, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A robot of 1000 parts takes minutes, in which nothing is simulated."""
    shown: list[str] = []

    @contextmanager
    def progress(text: str) -> Iterator[Callable[[str], None]]:
        shown.append(text)
        yield shown.append

    monkeypatch.setattr(robot_command, "progress_if_long", progress)
    simulated("")
    parts = len(spider().parts)
    assert shown[0] == f"building the model of {parts} parts"
    assert shown[1] == "simulated 0.0 of 12 s"
    assert len(shown) > 90
