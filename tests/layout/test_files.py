"""Checks of committed files: no local paths or registries; rooms and packages small."""

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = ("schema", "coordinator", "worker", "analyzer", "analysis")

# Joined at run time so that this file does not contain them either.
HOSTS = tuple(
    ".".join(labels)
    for labels in (
        ("pypi", "org"),
        ("pythonhosted", "org"),
        ("anaconda", "org"),
        ("npmjs", "org"),
        ("npmjs", "com"),
        ("crates", "io"),
    )
)
# Absolute path below a folder that is specific to one machine.
MACHINE_PATH = re.compile(r"(?<![\w.}\])])/(?:work|root|home|Users)/\w")


def tracked() -> list[Path]:
    """Return the files that git tracks and that exist."""
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    listing = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout
    paths = [ROOT / name for name in listing.split("\0") if name]
    return [path for path in paths if path.is_file()]


def texts() -> dict[str, str]:
    """Return the text of each tracked file by name, without undecodable bytes."""
    return {
        path.relative_to(ROOT).as_posix(): path.read_text("utf-8", errors="ignore")
        for path in tracked()
    }


def test_rooms_and_packages_hold_few_names() -> None:
    """A room has at most 12 names beside its commands, a package at most 20 files."""
    names: dict[str, set[str]] = {}
    for path in tracked():
        room, *rest = path.relative_to(ROOT).parts
        if room in ROOMS and path.suffix == ".py" and path.name != "__init__.py":
            names.setdefault(room, set()).add(rest[0])
            if len(rest) > 1:
                package = "/".join((room, *rest[:-1]))
                names.setdefault(package, set()).add(path.name)
    assert names.keys() > set(ROOMS)
    for room in ROOMS:
        assert len(names.pop(room) - {"__main__.py"}) <= 12, room
    assert {name: len(each) for name, each in names.items() if len(each) > 20} == {}


def test_no_file_contains_the_address_of_a_registry() -> None:
    found = [
        (name, host)
        for name, text in texts().items()
        for host in HOSTS
        if host in text.lower()
    ]
    assert found == []


def test_no_file_contains_a_local_path() -> None:
    found = {name: MACHINE_PATH.findall(text) for name, text in texts().items()}
    assert {name: hits for name, hits in found.items() if hits} == {}


@pytest.mark.parametrize("before", ["", "see ", "(", '"', "file://"])
def test_a_local_path_is_detected(before: str) -> None:
    assert MACHINE_PATH.search(before + "/" + "home/ada/runs")


@pytest.mark.parametrize("text", ["runs/work/x", "../home/y", "tcp/host/root/z"])
def test_a_relative_path_is_allowed(text: str) -> None:
    assert not MACHINE_PATH.search(text)


def test_constraints_are_names_and_versions() -> None:
    lines = (ROOT / "constraints.txt").read_text("utf-8").splitlines()
    pins = [line for line in lines if not line.startswith("#")]
    assert pins
    assert [line for line in pins if not re.fullmatch(r"[\w.-]+==[\w.]+", line)] == []


def test_every_dependency_is_pinned() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    wanted = [*project["dependencies"]]
    for extra in project["optional-dependencies"].values():
        # An extra may name others of this project.
        wanted += [line for line in extra if not line.startswith(project["name"])]
    pins = (ROOT / "constraints.txt").read_text("utf-8").lower().replace("_", "-")
    names = [re.split(r"[^\w.-]", line.lower())[0] for line in wanted]
    assert [name for name in names if f"\n{name}==" not in pins] == []
