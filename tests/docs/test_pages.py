"""Runs the code of the tutorials and notebooks."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command_server import ADDRESS, address
from tests.docs.page_runner import PageError, blocks, blocks_of, run_page
from tests.system.workspace import runtime_directory

TOP = Path(__file__).parents[2]
DOCS = TOP / "docs"
TUTORIALS = DOCS / "tutorials"
pytestmark = pytest.mark.system


def _run(page: Path, folder: Path, *numbers: str) -> None:
    script = Path(__file__).with_name("page_runner.py")
    paths = os.pathsep.join(map(str, (folder, TOP)))
    done = subprocess.run(
        [sys.executable, str(script), str(page), *numbers],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": paths, ADDRESS: address()},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[-2]) >= 2


@pytest.mark.parametrize(
    ("name", "births"),
    [("04-part", "150=20"), ("07-tables", "60=20"), ("10-rules", "60=25")],
)
def test_tutorial_runs_with_fewer_births(
    name: str, births: str, tmp_path: Path
) -> None:
    _run(TUTORIALS / f"{name}.md", tmp_path, births)


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    "name",
    [
        "01-first-run",
        "02-your-own-experiment",
        "03-fitness",
        "05-arenas",
        "06-islands",
        "09-thesis-figure",
    ],
)
def test_tutorial_runs(name: str, tmp_path: Path) -> None:
    _run(TUTORIALS / f"{name}.md", tmp_path)


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_page_about_starts_runs_with_fewer_births(tmp_path: Path) -> None:
    _run(DOCS / "starts.md", tmp_path, "150=16")


@pytest.mark.parametrize(
    "page",
    [
        "gallery/README.md",
        "growing.md",
        "founders.md",
        "simulation.md",
        "diversity.md",
        "suite.md",
    ],
)
def test_commands_of_the_page_run(page: str, tmp_path: Path) -> None:
    (tmp_path / "docs").symlink_to(DOCS)
    _run(DOCS / page, tmp_path)


def test_ppo_of_the_simulation_page_trains(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3", reason="a library of gigabytes")
    (block,) = blocks_of(DOCS / "simulation.md", "py")
    code = "import revolve as rv\nbody = rv.Robot.random(seed=1, number=7)\n"
    told = subprocess.run(
        [sys.executable, "-c", code + block],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(TOP)},
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    assert float(told.split()[-1]) > 0.0


def test_every_tutorial_is_in_the_list_of_tutorials() -> None:
    listed = re.findall(
        r"\]\((\d\d-[\w-]+\.md)\)", (TUTORIALS / "README.md").read_text()
    )
    assert listed == [page.name for page in sorted(TUTORIALS.glob("[0-9]*.md"))]


def test_a_page_that_says_something_wrong_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    page = tmp_path / "page.md"
    text = "```python\nx = 20 + 1\nprint(x, 'of', x)\n```\n```text\n21 ... 21\n```\n"
    page.write_text(text)
    assert run_page(page, {}) == len(blocks(page)) == 2
    for wrong, why in (("20 ", "not in the output"), ("y ", "NameError")):
        page.write_text(text.replace("20 ", wrong).replace("21 ...", "22 ..."))
        with pytest.raises(PageError, match=why):
            run_page(page, {})


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", ["first-evolution", "own-analysis"])
def test_notebook_runs(name: str, tmp_path: Path) -> None:
    """Its code cells run in order, as a program without a screen."""
    notebook = json.loads((DOCS / "notebooks" / f"{name}.ipynb").read_text("utf-8"))
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] for cell in cells)
    program = "\n".join("".join(cell["source"]) for cell in cells)
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(TOP), "MPLBACKEND": "agg",
             "TMPDIR": str(tmp_path), "XDG_RUNTIME_DIR": runtime_directory(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert len(cells) >= 5
    assert re.search(r"(?:parents|difference) [+-]?\d\.\d{4}", done.stdout)


def test_predators_of_the_tutorial_are_the_example() -> None:
    page = (TUTORIALS / "10-rules.md").read_text()
    for name in ("predators.py", "predators.toml"):
        assert f"# {name}\n{(DOCS / 'examples' / name).read_text()}```" in page
