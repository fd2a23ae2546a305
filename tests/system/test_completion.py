"""Completion scripts: bash completes with its own, the others name the same words."""

import subprocess
from pathlib import Path

import pytest

from revolve.cli.commands import COMMANDS
from revolve.cli.completion import main
from schema.experiment.file import shipped_experiments

pytestmark = pytest.mark.system

_COMPLETE = """
source ./script
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1))
_shtab_revolve revolve "${!#}" ""
printf '%s\\n' "${COMPREPLY[@]}"
"""


def script(shell: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["completion", shell]) == 0
    return capsys.readouterr().out


def test_bash_completes_commands_flags_experiments_and_folders(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "script").write_text(script("bash", capsys))
    (tmp_path / "runs" / "a").mkdir(parents=True)
    (tmp_path / "mine.toml").touch()
    (tmp_path / "mine.yaml").touch()
    for line, expected in (
        ("resu", {"resume"}),
        ("robot s", {"show", "simulate"}),
        ("robot render x --wi", {"--width"}),
        ("run sce", {"scenario1", "scenario2", "scenario3"}),
        ("run mi", {"mine.toml"}),
        ("robot check a.yaml --experiment mi", {"mine.toml"}),
        ("resume r", {"runs"}),
        ("run scenario1 --connect r", {"runs"}),
        ("completion ", {"bash", "zsh", "fish"}),
        ("help st", {"status"}),
    ):
        words = ["revolve", *line.split(" ")]
        done = subprocess.run(
            ["bash", "-c", _COMPLETE, "bash", *words],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        assert set(done.stdout.split()) == expected, line


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_get_all_commands_and_experiments(
    shell: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Both scripts were tried by hand; neither shell is needed for the tests."""
    text = script(shell, capsys)
    for name in (*COMMANDS, *shipped_experiments()):
        assert name.split()[-1] in text
    assert "_revolve_experiments" in text
