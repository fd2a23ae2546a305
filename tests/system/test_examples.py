"""Runs the scripts of docs/examples/, as a reader would."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]
SCRIPTS = sorted((TOP / "docs" / "examples").glob("*.py"))
MOST_LINES = 40
PICTURES = Path(__file__).with_name("test_view_picture.py")
"""Runs the script that needs a Vulkan driver."""

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]


def _run(script: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-W", "error", str(script)],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(TOP)},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_script_is_short_and_has_no_guard(script: Path) -> None:
    text = script.read_text("utf-8")
    assert len(text.splitlines()) <= MOST_LINES
    assert "__main__" not in text


@pytest.mark.parametrize(
    ("name", "library"), [("cma_es", "cmaes"), ("map_elites", "ribs")]
)
def test_search_of_another_library_improves_fitness(
    name: str, library: str, tmp_path: Path
) -> None:
    pytest.importorskip(library, reason="of the extra 'dev'")
    done = _run(TOP / "docs" / "examples" / f"{name}.py", tmp_path)
    assert done.returncode == 0, done.stderr
    found = re.findall(r"(\d\.\d{4})$", done.stdout, re.MULTILINE)
    fitness = [float(each) for each in found]
    assert len(fitness) >= 6
    assert fitness == sorted(fitness)
    assert fitness[-1] > 1.1 * fitness[0]


def test_own_loop_survives_a_killed_worker(tmp_path: Path) -> None:
    done = _run(TOP / "docs" / "examples" / "own_loop.py", tmp_path)
    assert done.returncode == 0, done.stderr
    assert "a worker process ended; it is restarted" in done.stderr
    steps = re.findall(
        r"step (\d): (\d+) results, best fitness (\S+)$", done.stdout, re.MULTILINE
    )
    assert [int(step) for step, _, _ in steps] == list(range(6))
    assert all(int(count) > 20 for _, count, _ in steps)
    # The parents compete, too: the best fitness never falls.
    best = [float(fitness) for _, _, fitness in steps]
    assert best == sorted(best)
    assert best[-1] > best[0]


def test_analysis_with_polars_prints_its_tables(tmp_path: Path) -> None:
    done = _run(TOP / "docs" / "examples" / "polars_analysis.py", tmp_path)
    assert done.returncode == 0, done.stderr
    counts = re.findall(r"^│ \d+ +┆ (\d+) +┆ \S+ +┆ \S+ +│$", done.stdout, re.MULTILINE)
    assert sum(map(int, counts)) == 90
    assert re.search(
        r"^correlation of parts and fitness: -?0\.\d{3}$", done.stdout, re.MULTILINE
    )
    assert "parents.birth" in done.stdout


def test_every_script_is_run_here_or_with_the_pictures() -> None:
    texts = {
        node.value.removesuffix(".py")
        for file in (Path(__file__), PICTURES)
        for node in ast.walk(ast.parse(file.read_text("utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    assert {script.stem for script in SCRIPTS} <= texts
