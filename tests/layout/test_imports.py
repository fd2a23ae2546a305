"""Checks of the permitted imports of each file.

import-linter follows import chains between the project's modules (contracts in
pyproject.toml). Other tests parse the syntax trees, which covers the libraries of
revolve/ and reports file and library directly.
"""

import ast
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports

ROOT = Path(__file__).parents[2]
ROOMS = ("schema", "coordinator", "worker", "analyzer", "analysis")

# Library -> patterns, relative to the root, of the files that may import it.
PERMITTED = {
    "zenoh": ("*/**/service.py", "*/**/*_service.py", "analysis/viewer/live.py"),
    "mujoco": (
        "schema/mjcf/*.py",
        "schema/experiment/scenery.py",
        "schema/formats/mjcf.py",
        "schema/formats/urdf.py",
        "worker/**/*.py",
        "analysis/render/motion.py",
        "analysis/render/ray_caster.py",
        "analysis/render/stage.py",
    ),
    "rerun": ("analysis/viewer/*.py",),
    "plotnine": ("analysis/figures/*.py",),
    "scipy": ("analysis/comparison/*.py",),
    "numba": ("schema/robot/body_distance.py",),
    "matplotlib": ("analysis/figures/*.py",),
    "networkx": ("coordinator/islands/topology.py",),
    "cmaes": ("coordinator/evolution/learners/learner.py",),
}
# Reference implementations for tests and developer tools: no room imports them.
TEST_ONLY = {
    "duckdb",
    "grpc_tools",
    "hypothesis",
    "pandas",
    "pickle",
    "polars",
    "pytest",
    "ribs",
    "zss",
}


def sources() -> list[Path]:
    """Return the project's Python files except tests, in a fixed order."""
    files = [path for room in ROOMS for path in sorted((ROOT / room).rglob("*.py"))]
    return [*files, *sorted((ROOT / "revolve").rglob("*.py"))]


def imported(path: Path) -> Iterator[str]:
    """Yield the top-level name of every import of a file, at any nesting level."""
    for node in ast.walk(ast.parse(path.read_bytes(), filename=str(path))):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            # A relative import stays in its room.
            name = node.module if node.level == 0 else path.relative_to(ROOT).parts[0]
            yield (name or "").partition(".")[0]


def relative(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def may_import(path: Path, library: str) -> bool:
    return any(path in ROOT.glob(pattern) for pattern in PERMITTED[library])


@pytest.mark.slow
def test_contracts_hold(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    # Its configuration would disable all loggers of this process for later tests.
    monkeypatch.setattr("importlinter.cli._configure_logging", lambda _verbose: None)
    status = lint_imports(config_filename="pyproject.toml", no_cache=True)
    assert status == EXIT_STATUS_SUCCESS, capsys.readouterr().out


@pytest.mark.parametrize("library", sorted(PERMITTED))
def test_library_is_imported_only_by_permitted_files(library: str) -> None:
    violations = [
        relative(path)
        for path in sources()
        if library in imported(path) and not may_import(path, library)
    ]
    assert violations == []


def test_no_room_imports_test_only_libraries() -> None:
    violations = {relative(path): TEST_ONLY & set(imported(path)) for path in sources()}
    assert {path: names for path, names in violations.items() if names} == {}


def test_public_classes_have_names_of_their_own() -> None:
    """A class of the Python interface may be named as what it stands for."""
    classes = Counter(
        node.name
        for path in sources()
        for node in ast.parse(path.read_bytes()).body
        if isinstance(node, ast.ClassDef) and node.name[0] != "_"
    )
    twice = {name for name, count in classes.items() if count > 1}
    assert twice == {"Arena", "Experiment", "Robot", "Simulation"}


def test_no_file_uses_type_checking_imports() -> None:
    found = [
        relative(path)
        for path in sources()
        if path.name != "revolve_pb2.py" and "TYPE_CHECKING" in path.read_text("utf-8")
    ]
    assert found == []


def test_a_run_starts_without_libraries_that_it_does_not_use() -> None:
    """Each of them delays the first line on the screen; pyarrow.dataset has pandas."""
    modules = "coordinator.__main__, worker.serve.service, analyzer.service"
    script = f"import sys, {modules}; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    unused = {"cryptography", "matplotlib", "networkx", "numba", "pandas", "PIL"}
    assert unused & {*done.stdout.split()} == set()


@pytest.mark.parametrize("room", ROOMS)
def test_init_of_a_room_contains_only_a_docstring(room: str) -> None:
    tree = ast.parse((ROOT / room / "__init__.py").read_bytes())
    assert ast.get_docstring(tree)
    assert len(tree.body) == 1


def test_test_folders_are_not_packages() -> None:
    # A package tests/schema would shadow schema. Plug-ins in tests/plugins are
    # packages, as those of a user.
    tests = ROOT / "tests"
    packages = [
        relative(path)
        for path in tests.rglob("__init__.py")
        if tests / "plugins" not in path.parents
    ]
    assert packages == []
