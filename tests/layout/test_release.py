"""Files of a release, and code that is generated."""

import re
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
