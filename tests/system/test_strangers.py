"""A stranger's installed package, which imports ``revolve`` alone, and scripts.

The plug-ins of ``tests/plugins/critters_lab`` evolve off-line and in an arena. The run
on two workers, of which one is killed, equals that in one process. The scripts are
those of docs/examples/.
"""

import ast
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from coordinator.storage.compare import compare
from schema.tables.files import read_table
from tests.system.documents import OFF_LINE, SMALL_ARENA
from tests.system.fleet import Fleet, size
from tests.system.workspace import Workspace

pytestmark = pytest.mark.system


TOP = Path(__file__).parents[2]
PACKAGE = TOP / "tests" / "plugins" / "critters_lab"
ROOMS = ("schema", "coordinator", "worker", "analyzer", "analysis")
_BODIES = """
[space]
max_inputs = 20
part_types = ["schema.parts:CORE", "schema.parts:FIXED_BRICK",
    "schema.parts:ACTIVE_HINGE", "critters.bodies:PISTON"]
"""
_NEURONS = 'neuron_types = ["Sigmoid", "critters.neurons:Leaky"]\n'
_BRAIN = """
[brain]
type = "critters.brains:Beat"
parameters = {frequency_hz = 0.8}
"""
_ENCODING = """
[encoding]
type = "critters.genomes:Snakes"
parameters = {most_joints = 5}
"""
_FITNESS = """
[fitness]
function = "critters.scores:thrifty"
parameters = {price = 0.02}
"""
_MEASURES = """
[measures]
names = ["critters.scores:sway"]
"""
_PARENTS = 'parents = "critters.choices:alike"\n'
_SURVIVORS = (
    'survivors = "critters.choices:elite_and_young"\n'
    "survivors_parameters = {share = 0.7}\n"
)
TOGETHER = {
    "bodies": (
        f"{_BODIES}{_NEURONS}{_FITNESS}{_MEASURES}[selection]\n{_PARENTS}{_SURVIVORS}"
    ),
    "brain": f"{_BRAIN}{_FITNESS}",
    "encoding": f"{_ENCODING}{_MEASURES}",
}


def document(text: str, added: str, births: int) -> str:
    """Return an experiment with a plug-in; tables of one name are joined."""
    text = re.sub(r"births = \d+", f"births = {births}", text)
    for table in re.split(r"^(?=\[)", added.strip(), flags=re.MULTILINE):
        head, _, keys = table.partition("\n")
        if f"{head}\n" in text:
            text = text.replace(f"{head}\n", f"{head}\n{keys.strip()}\n")
        else:
            text += f"{table.strip()}\n"
    return text


@pytest.fixture(scope="session")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder in which the package is installed, as from its wheel."""
    folder = tmp_path_factory.mktemp("stranger")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder],
        cwd=PACKAGE,
        check=True,
        capture_output=True,
    )
    (wheel,) = folder.glob("*.whl")
    site = folder / "site"
    zipfile.ZipFile(wheel).extractall(site)
    return site


@pytest.fixture
def lab(workspace: Workspace, installed: Path) -> Workspace:
    """Return a workspace with the environment that has the package."""
    workspace.environment["PYTHONPATH"] = f"{TOP}{os.pathsep}{installed}"
    return workspace


def _is_equal_after_a_kill(lab: Workspace, own: str) -> None:
    """Run in one process, and on two workers of which one is killed; compare."""
    (lab.folder / "mine.toml").write_text(own)
    words = ("mine.toml", "--seed", "5", "--quiet")
    lab.run("run", *words, "--out", "one", "--in-process")
    fleet = Fleet(lab, *words)
    for name in ("doomed", "spare"):
        fleet.join(name)
    fleet.join("judge", "analyzer")
    fleet.wait_for(0.4 * size(lab.folder / "one"))
    fleet.kill("doomed")
    fleet.finish()
    assert compare(lab.folder / "one", fleet.folder) == []


def _check_births(folder: Path, count: int) -> None:
    births = read_table(folder, "births").to_pylist()
    assert len(births) == count
    assert max(row["rank"] for row in births) > 1


@pytest.mark.parametrize(
    ("name", "text"),
    [("bodies", OFF_LINE), ("brain", SMALL_ARENA), ("encoding", OFF_LINE)],
)
def test_a_strangers_plug_ins_evolve_on_two_workers_of_which_one_is_killed(
    lab: Workspace, name: str, text: str
) -> None:
    births = 12 if text is SMALL_ARENA else 30
    _is_equal_after_a_kill(lab, document(text, TOGETHER[name], births))
    _check_births(lab.folder / "one", births)
    if name == "bodies":
        rows = read_table(lab.folder / "one", "births").to_pylist()
        kinds = {part["kind"] for row in rows for part in row["body"]}
        assert "Piston" in kinds
        rows = read_table(lab.folder / "one", "evaluations").to_pylist()
        assert all(dict(row["measures"])["sway"] > 0.0 for row in rows)


def test_all_plug_ins_of_the_package_are_found_and_in_order(lab: Workspace) -> None:
    listed = lab.run("plugins").splitlines()
    found = [row.split()[:2] for row in listed if " critters." in row]
    assert sorted(found) == [
        ["brain", "critters.brains:Beat"],
        ["encoding", "critters.genomes:Snakes"],
        ["fitness", "critters.scores:thrifty"],
        ["measure", "critters.scores:sway"],
        ["neuron-type", "critters.neurons:Leaky"],
        ["parents", "critters.choices:alike"],
        ["part-type", "critters.bodies:PISTON"],
        ["survivors", "critters.choices:elite_and_young"],
    ]
    checked = lab.run("check", *(path for _, path in found))
    assert checked.count(": in order\n") == len(found)


def test_the_package_imports_revolve_alone() -> None:
    for file in PACKAGE.rglob("*.py"):
        text = file.read_text()
        assert not re.search(
            rf"^\s*(from|import) ({'|'.join(ROOMS)})\b", text, re.MULTILINE
        )


EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
SCRIPTS = sorted(EXAMPLES.glob("*.py"))
MOST_LINES = 42
OTHERS = ("test_view_picture.py", "test_docs.py", "test_ecosystem.py")
"""Run the script that needs a Vulkan driver, and those that are plug-ins."""


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
