"""Files of the tree and of a release, and code that is generated."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

from schema.agent.version import VERSION

ROOT = Path(__file__).parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
PROJECT = PYPROJECT["project"]


def test_citation_names_version_and_licence() -> None:
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert cited["version"] == VERSION
    assert cited["license"] == PROJECT["license"]
    (thesis,) = cited["references"]
    assert (thesis["authors"][0]["family-names"], thesis["year"]) == ("Hupkes", 2016)


def test_release_notes_have_a_section_of_this_version() -> None:
    notes = (ROOT / "docs" / "releases.md").read_text("utf-8")
    assert f"## {VERSION}\n" in notes


def test_licence_is_the_whole_text() -> None:
    text = (ROOT / "LICENSE").read_text("utf-8")
    assert re.findall(r"^   ([1-9])\. ", text, re.MULTILINE) == list("123456789")
    assert "END OF TERMS AND CONDITIONS" in text
    assert "Copyright" in (ROOT / "NOTICE").read_text("utf-8")


def whole(extra: str) -> set[str]:
    """Return the requirements of an extra and of those that it names."""
    found: set[str] = set()
    for line in PROJECT["optional-dependencies"][extra]:
        match = re.fullmatch(r"revolve-islands\[([\w,]+)\]", line)
        for name in match[1].split(",") if match else ():
            found |= whole(name)
        found |= set() if match else {line}
    return found


def test_all_is_every_extra_for_users() -> None:
    users = PROJECT["optional-dependencies"].keys() - {"all", "dev", "docs"}
    assert users >= {"view", "analysis", "cluster"}
    assert whole("all") == {line for name in users for line in whole(name)}


def test_docker_sees_what_the_wheel_is_built_from() -> None:
    lines = (ROOT / ".dockerignore").read_text("utf-8").splitlines()
    needed = [
        "pyproject.toml",
        "constraints.txt",
        PROJECT["readme"],
        *PROJECT["license-files"],
        *PYPROJECT["tool"]["hatch"]["build"]["only-include"],
    ]
    assert [name for name in needed if f"!{name}" not in lines] == []


def test_images_have_plain_bases_that_the_project_supports() -> None:
    docker = (ROOT / "Dockerfile").read_text("utf-8")
    apptainer = (ROOT / "revolve.def").read_text("utf-8")
    bases = re.findall(r"^FROM (\S+)", docker, re.MULTILINE)
    bases += re.findall(r"^From: (\S+)", apptainer, re.MULTILINE)
    assert set(bases) == {"python:3.13-slim"}
    assert "Programming Language :: Python :: 3.13" in PROJECT["classifiers"]
    assert docker.rindex("\nUSER revolve\n") < docker.index('ENTRYPOINT ["revolve"]')


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the current output of `make proto`."""
    folder = tmp_path_factory.mktemp("proto")
    command = [sys.executable, "-m", "grpc_tools.protoc", f"-I{ROOT}"]
    outputs = [
        f"--python_out={folder}",
        f"--pyi_out={folder}",
        "schema/wire/revolve.proto",
    ]
    subprocess.run([*command, *outputs], cwd=ROOT, check=True, capture_output=True)
    return folder / "schema" / "wire"


@pytest.mark.parametrize("name", ["revolve_pb2.py", "revolve_pb2.pyi"])
def test_generated_code_is_up_to_date(name: str, fresh: Path) -> None:
    committed = (ROOT / "schema" / "wire" / name).read_bytes()
    assert (fresh / name).read_bytes() == committed, "run make proto"


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
