"""Runs the scripts of docs/examples/, as a reader would."""

import ast
import re
from pathlib import Path

import pytest

from tests.system.workspace import Workspace

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
SCRIPTS = sorted(EXAMPLES.glob("*.py"))
MOST_LINES = 40
OTHERS = ("test_view_picture.py", "test_docs.py", "test_ecosystem.py")
"""Run the script that needs a Vulkan driver, and those that are plug-ins."""

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_script_is_short_and_has_no_guard(script: Path) -> None:
    text = script.read_text("utf-8")
    assert len(text.splitlines()) <= MOST_LINES
    assert "__main__" not in text


@pytest.mark.parametrize(
    ("name", "library"), [("cma_es", "cmaes"), ("map_elites", "ribs")]
)
def test_search_of_another_library_improves_fitness(
    name: str, library: str, workspace: Workspace
) -> None:
    pytest.importorskip(library, reason="of the extra 'dev'")
    told = workspace.python("-W", "error", str(EXAMPLES / f"{name}.py"))
    found = re.findall(r"(\d\.\d{4})$", told, re.MULTILINE)
    fitness = [float(each) for each in found]
    assert len(fitness) >= 6
    assert fitness == sorted(fitness)
    assert fitness[-1] > 1.1 * fitness[0]


def test_own_loop_survives_a_killed_worker(workspace: Workspace) -> None:
    told = workspace.python("-W", "error", str(EXAMPLES / "own_loop.py"))
    assert "a worker process ended; it is restarted" in told
    steps = re.findall(
        r"step (\d): (\d+) results, best fitness (\S+)$", told, re.MULTILINE
    )
    assert [int(step) for step, _, _ in steps] == list(range(6))
    assert all(int(count) > 20 for _, count, _ in steps)
    # The parents compete, too: the best fitness never falls.
    best = [float(fitness) for _, _, fitness in steps]
    assert best == sorted(best)
    assert best[-1] > best[0]


def test_analysis_with_polars_prints_its_tables(workspace: Workspace) -> None:
    told = workspace.python("-W", "error", str(EXAMPLES / "polars_analysis.py"))
    counts = re.findall(r"^│ \d+ +┆ (\d+) +┆ \S+ +┆ \S+ +│$", told, re.MULTILINE)
    assert sum(map(int, counts)) == 90
    assert re.search(
        r"^correlation of parts and fitness: -?0\.\d{3}$", told, re.MULTILINE
    )
    assert "parents.birth" in told


def test_every_script_is_run_here_or_in_other_tests() -> None:
    texts = {
        node.value.removesuffix(".py")
        for file in (Path(__file__), *map(Path(__file__).with_name, OTHERS))
        for node in ast.walk(ast.parse(file.read_text("utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    assert {script.stem for script in SCRIPTS} <= texts
