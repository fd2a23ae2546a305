"""Checks that the wheel contains all source and data files, and no other files."""

import tarfile
import zipfile
from pathlib import Path

import pytest
from hatchling.builders.sdist import SdistBuilder
from hatchling.builders.wheel import WheelBuilder

ROOT = Path(__file__).parents[2]
ROOMS = ("schema", "coordinator", "worker", "analyzer", "analysis")

PACKAGES = ("revolve", *ROOMS)

pytestmark = pytest.mark.system


@pytest.fixture(scope="module")
def names(tmp_path_factory: pytest.TempPathFactory) -> set[str]:
    """Build a wheel and return the names of its files."""
    folder = tmp_path_factory.mktemp("wheel")
    builder = WheelBuilder(str(ROOT))
    (wheel,) = builder.build(directory=str(folder), versions=["standard"])
    return set(zipfile.ZipFile(wheel).namelist())


def test_wheel_contains_every_file_of_the_rooms(names: set[str]) -> None:
    wanted = {
        path.relative_to(ROOT).as_posix()
        for room in PACKAGES
        for path in (ROOT / room).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert wanted <= names
    assert {"revolve/py.typed", "schema/wire/revolve.proto"} <= names
    assert {"LICENSE", "NOTICE"} <= {name.rpartition("/licenses/")[2] for name in names}
    assert any(name.startswith("schema/experiment/shipped/") for name in names)


def test_wheel_contains_no_other_files(names: set[str]) -> None:
    tops = {name.partition("/")[0] for name in names}
    (metadata,) = (top for top in tops if top.endswith(".dist-info"))
    assert tops == {*PACKAGES, metadata}
    assert f"{metadata}/entry_points.txt" in names


@pytest.mark.long
def test_source_distribution_has_what_its_tests_need(tmp_path: Path) -> None:
    builder = SdistBuilder(str(ROOT))
    (sdist,) = builder.build(directory=str(tmp_path), versions=["standard"])
    with tarfile.open(sdist) as archive:
        found = {name.partition("/")[2] for name in archive.getnames()}
    wanted = {"LICENSE", "NOTICE", "CITATION.cff", "Dockerfile", "revolve.def",
              "README.md", "pyproject.toml", "Makefile", "constraints.txt",
              "tests/conftest.py", "docs/tables.md"}  # fmt: skip
    assert wanted <= found
    assert {f"{room}/__init__.py" for room in PACKAGES} <= found
