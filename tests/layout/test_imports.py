"""Import rules between rooms and libraries, checked in two ways.

import-linter follows chains of imports between modules (contracts in pyproject.toml).
The syntax trees are read as well: they include revolve.py, and they name the file and
the library.
"""

import ast
import importlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports

ROOT = Path(__file__).parents[2]
ROOMS = ("schema", "coordinator", "worker", "analyzer", "analysis")

# Library -> the files, as patterns from the root, that may import it.
HOMES = {
    "zenoh": ("*/**/service.py", "*/**/client_service.py", "analysis/viewer/live.py"),
    "mujoco": (
        "schema/mjcf/*.py",
        "schema/experiment/scenery.py",
        "schema/formats/mjcf.py",
        "schema/formats/urdf.py",
        "worker/**/*.py",
        "analysis/render/picture.py",
    ),
    "rerun": ("analysis/viewer/*.py",),
    "plotnine": ("analysis/figures/*.py",),
    "numba": ("analysis/measures/distance.py",),
    "matplotlib": ("analysis/figures/*.py",),
    "networkx": ("coordinator/islands/topology.py",),
}
# Second opinions for tests and tools for developers: no room leans on them.
NEVER = {
    "duckdb",
    "grpc_tools",
    "hypothesis",
    "pandas",
    "pickle",
    "polars",
    "pytest",
    "scipy",
    "zss",
}


def sources() -> list[Path]:
    """Return the project's Python files without tests, in a fixed order."""
    files = [path for room in ROOMS for path in sorted((ROOT / room).rglob("*.py"))]
    return [*files, *ROOT.glob("revolve.py")]


def imported(path: Path) -> Iterator[str]:
    """Yield the top-level name of every import of a file, at any depth."""
    for node in ast.walk(ast.parse(path.read_bytes(), filename=str(path))):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            # A relative import stays in its room.
            name = node.module if node.level == 0 else path.relative_to(ROOT).parts[0]
            yield (name or "").partition(".")[0]


def is_composition_root(path: Path) -> bool:
    """Return whether a file may import several rooms."""
    return path == ROOT / "revolve.py" or path.name == "__main__.py"


def named(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def is_at_home(path: Path, library: str) -> bool:
    return any(path in ROOT.glob(pattern) for pattern in HOMES[library])


@pytest.mark.slow
def test_contracts_hold(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    status = lint_imports(config_filename="pyproject.toml", no_cache=True)
    assert status == EXIT_STATUS_SUCCESS, capsys.readouterr().out


@pytest.mark.parametrize("library", sorted(HOMES))
def test_library_is_imported_only_where_it_lives(library: str) -> None:
    strays = [
        named(path)
        for path in sources()
        if library in imported(path) and not is_at_home(path, library)
    ]
    assert strays == []


def test_no_room_leans_on_a_second_opinion() -> None:
    strays = {named(path): NEVER & set(imported(path)) for path in sources()}
    assert {path: names for path, names in strays.items() if names} == {}


def test_rooms_know_schema_and_themselves_only() -> None:
    strays = {
        named(path): (set(ROOMS) & set(imported(path)))
        - {"schema", path.relative_to(ROOT).parts[0]}
        for path in sources()
        if not is_composition_root(path)
    }
    assert {path: names for path, names in strays.items() if names} == {}


def test_only_a_main_hands_over_to_the_command() -> None:
    # `python -m coordinator` is `revolve coordinator`; nothing below knows it.
    importers = [
        named(path)
        for path in sources()
        if "revolve" in imported(path) and not is_composition_root(path)
    ]
    assert importers == []


def test_no_import_hides_from_the_layers() -> None:
    hiding = [
        named(path)
        for path in sources()
        if path.name != "revolve_pb2.py" and "TYPE_CHECKING" in path.read_text("utf-8")
    ]
    assert hiding == []


@pytest.mark.parametrize("room", ROOMS)
def test_room_is_ours(room: str) -> None:
    module = importlib.import_module(room)
    assert module.__file__ is not None
    assert Path(module.__file__).resolve() == (ROOT / room / "__init__.py").resolve()


@pytest.mark.parametrize("room", ROOMS)
def test_room_states_its_rule_and_has_no_second_names(room: str) -> None:
    tree = ast.parse((ROOT / room / "__init__.py").read_bytes())
    assert ast.get_docstring(tree)
    assert len(tree.body) == 1


def test_tests_are_no_packages() -> None:
    # A tests/schema that is a package would shadow schema. A user's package
    # in tests/plugins may be one.
    tests = ROOT / "tests"
    packages = [
        named(path)
        for path in tests.rglob("__init__.py")
        if tests / "plugins" not in path.parents
    ]
    assert packages == []
