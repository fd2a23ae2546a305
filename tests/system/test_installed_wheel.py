"""The wheel, installed outside the tree, with the oldest and the newest libraries.

Each Python of this machine gets two empty environments. ``tests/fresh_machine.sh
--pytest '-m long tests/system/test_installed_wheel.py' sid`` tries the newest Python.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from zipfile import ZipFile

import pytest
from hatchling.builders.wheel import WheelBuilder
from packaging.metadata import Metadata
from packaging.requirements import Requirement

from tests.system.workspace import wait_until

pytestmark = [pytest.mark.system, pytest.mark.long, pytest.mark.timeout(3600)]

ROOT = Path(__file__).parents[2]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
EXTRAS = ("pictures", "analysis", "view", "cluster", "gym")
EXAMPLE = """
import revolve as rv
run = rv.read("one")
best, = run.best(1)
print(run.births.num_rows, rv.evaluate(best, run.experiment).fitness)
print(max(run.evaluations["fitness"].to_pylist()))
"""


def interpreter(version: str) -> str | None:
    """Return a Python of a version that can make environments; None without one."""
    names = [sys.executable, shutil.which(f"python{version}")]
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    names += [str(path) for path in pyenv.glob(f"versions/{version}.*/bin/python")]
    ask = "import sys, ensurepip, venv; print('%d.%d' % sys.version_info[:2])"
    for name in filter(None, names):
        done = subprocess.run(
            [name, "-c", ask], capture_output=True, text=True, check=False
        )
        if done.stdout.strip() == version:
            return str(name)
    return None


def oldest(wheel: Path) -> list[str]:
    """Return each direct requirement of a wheel at its lowest allowed version."""
    with ZipFile(wheel) as archive:
        (name,) = (each for each in archive.namelist() if each.endswith("/METADATA"))
        found = Metadata.from_email(archive.read(name), validate=False)
    lines = []
    for each in found.requires_dist or ():
        if not wanted(each):
            continue
        (lower,) = (one for one in each.specifier if one.operator in {">=", "=="})
        lines.append(f"{each.name}=={lower.version.removesuffix('.*')}.0")
    return lines


def wanted(requirement: Requirement) -> bool:
    """Return whether users get a requirement: always, or with one of the extras."""
    marker = requirement.marker
    return requirement.name != "revolve-islands" and (
        marker is None or any(marker.evaluate({"extra": each}) for each in EXTRAS)
    )


class Environment:
    """An environment of its own, and a folder outside the tree."""

    def __init__(self, python: str, folder: Path) -> None:
        """Make an empty environment in a folder."""
        self.folder = folder / "here"
        self.folder.mkdir()
        self._bin = folder / "environment" / "bin"
        self._variables = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith(("PYTHON", "VIRTUAL_ENV"))
        }
        self._call([python, "-m", "venv", str(folder / "environment")])

    def start(self, *words: str) -> "subprocess.Popen[str]":
        """Start a program of the environment."""
        return subprocess.Popen(
            [str(self._bin / words[0]), *words[1:]],
            cwd=self.folder,
            env=self._variables,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, *words: str, code: int = 0) -> str:
        """Run a program of the environment; return what it writes."""
        return self._call([str(self._bin / words[0]), *words[1:]], code)

    def _call(self, words: list[str], code: int = 0) -> str:
        done = subprocess.run(
            words,
            cwd=self.folder,
            env=self._variables,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == code, f"{words}\n{done.stdout}{done.stderr}"
        return done.stdout + done.stderr

    def install(self, *words: str) -> None:
        """Install packages with pip."""
        self.run("python", "-m", "pip", "install", "-q", *words)
        self.run("python", "-m", "pip", "check")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return our wheel."""
    folder = tmp_path_factory.mktemp("wheel")
    (path,) = WheelBuilder(str(ROOT)).build(
        directory=str(folder), versions=["standard"]
    )
    return Path(path)


@pytest.fixture
def made(tmp_path: Path) -> Iterator[Callable[[str], Environment]]:
    """Return a function that makes an environment of a version of Python."""

    def make(version: str) -> Environment:
        python = interpreter(version)
        if python is None:
            pytest.skip(f"this machine has no Python {version}")
        return Environment(python, tmp_path)

    yield make
    shutil.rmtree(tmp_path / "environment", ignore_errors=True)


def constraints(folder: Path, libraries: str, wheel: Path) -> list[str]:
    """Return the words by which pip takes the newest or the oldest libraries."""
    if libraries == "newest":
        return []
    (folder / "oldest.txt").write_text("\n".join(oldest(wheel)))
    return ["-c", str(folder / "oldest.txt")]


@pytest.mark.parametrize("libraries", ["oldest", "newest"])
@pytest.mark.parametrize("version", PYTHONS)
def test_wheel_works_outside_the_tree(
    made: Callable[[str], Environment], wheel: Path, version: str, libraries: str
) -> None:
    its = made(version)
    limits = constraints(its.folder, libraries, wheel)
    its.install(*limits, str(wheel))
    assert wheel.name.split("-")[1] in its.run("revolve", "--version")
    words = ("scenario1", "--births", "15", "--seed", "3", "--quiet", "--out")
    its.run("revolve", "run", *words, "one", "--workers", "1")
    _runs_in_processes(its, words)
    assert "equal" in its.run("revolve", "compare", "one", "two")
    births, again, recorded = its.run("python", "-c", EXAMPLE).split()
    assert (births, again) == ("15", recorded)
    # Each command that needs an extra names the command that installs it.
    for command in (
        ("robot", "render", "one/best.yaml", "best.png"),
        ("analyze", "one", "--out", "report"),
        ("view", "one", "--save", "one.rrd"),
    ):
        _follow_advice(its, command, limits)
    assert (its.folder / "report" / "report.html").stat().st_size > 10_000
    its.install(*limits, f"{wheel}[all]")


def _runs_in_processes(its: Environment, words: tuple[str, ...]) -> None:
    """Run a coordinator with a worker and an analyzer in other processes."""
    words = (*words, "two", "--listen", "tcp/127.0.0.1:0")
    run = its.start("revolve", "coordinator", *words)
    place = its.folder / "two" / "address"
    others: list[subprocess.Popen[str]] = []
    try:
        wait_until(
            lambda: place.exists() or run.poll() is not None, "the coordinator listens"
        )
        assert run.poll() is None, run.communicate()
        address = place.read_text().split()[0]
        others += [
            its.start("revolve", role, "--connect", address)
            for role in ("analyzer", "worker")
        ]
        out, err = run.communicate(timeout=600)
        assert run.returncode == 0, out + err
    finally:
        for process in (run, *others):
            process.kill()
            process.communicate()


def _follow_advice(
    its: Environment, command: tuple[str, ...], limits: list[str]
) -> None:
    """Run a command that lacks a library, then what it advises, then it again."""
    *_, line = its.run("revolve", *command, code=2).strip().splitlines()
    found = re.fullmatch(
        r"revolve: .* needs? \w+: (\S+ -m pip install '.*\[\w+\]')", line
    )
    assert found, line
    python, *install = shlex.split(found[1])
    assert Path(python).is_relative_to(its.folder.parent)
    its.run("python", *install, "-q", *limits)
    its.run("revolve", *command)
