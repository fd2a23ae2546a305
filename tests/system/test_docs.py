"""Runs the code of README and docs unchanged."""

import re
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path

import msgspec
import pytest

import revolve as rv
from coordinator.storage.compare import compare
from revolve.cli.commands import COMMANDS
from schema.experiment.document import ArenaSection
from schema.parts import ACTIVE_HINGE, PartType
from schema.tables.files import read_table
from schema.tables.last_populations import archive_at
from tests.docs.page_runner import blocks_of, with_one_figure
from tests.documents import parse_experiment
from tests.own_brains import write_module
from tests.system.workspace import Workspace, wait_until
from worker.kinds import check_fitness
from worker.measures import BUILT_IN, measures_of

pytestmark = pytest.mark.system

TOP = Path(__file__).parents[2]
PAGES = [TOP / "README.md", *sorted((TOP / "docs").glob("*.md"))]


SHIPPED = TOP / "schema" / "experiment" / "shipped"
NOVELTY = ("novelty.py", "novelty.toml")


def _write(workspace: Workspace, files: Mapping[str, str]) -> Path:
    """Write files, by their names; return their folder."""
    for name, text in files.items():
        (workspace.folder / name).write_text(text)
    return workspace.folder


def _follow(workspace: Workspace, lines: Iterable[str]) -> list[str]:
    """Run ``revolve`` as the lines say, one after the other; return what it writes."""
    return [
        workspace.run(*with_one_figure(line.partition("#")[0].split())[1:])
        for line in lines
    ]


def _short(document: str, length_s: int = 1) -> str:
    """Return an experiment with evaluations of a length, unless it has its own."""
    if "[simulation]" in document:
        return document
    return f"{document}\n[simulation]\nwindow_steps = {200 * length_s}\n"


def _quoted(page: Path, start: str) -> str:
    """Return the message that a page quotes."""
    pattern = rf"^    ({re.escape(start)} .*)$"
    (message,) = re.findall(pattern, page.read_text(), re.MULTILINE)
    return str(message)


@pytest.mark.parametrize(
    ("page", "least"), [("tables.md", 5), ("analysis.md", 3), ("viewing.md", 0)]
)
def test_code_of_pages_about_tables_runs(
    workspace: Workspace, page: str, least: int, undisturbed: Path
) -> None:
    shutil.copytree(undisturbed, workspace.folder / "runs" / "a")
    blocks = blocks_of(TOP / "docs" / page, "python")
    assert len(blocks) >= least
    _follow(workspace, blocks_of(TOP / "docs" / page, "bash"))
    for block in blocks:
        workspace.python("-W", "error", "-c", block)


def test_selection_of_the_selection_page_runs(workspace: Workspace) -> None:
    """Two workers give the births of one process; the run needs its folder alone."""
    page = TOP / "docs" / "selection.md"
    module, *_ = blocks_of(page, "python")
    document, *_ = blocks_of(page, "toml")
    folder = _write(
        workspace, {"crowding.py": module, "crowding.toml": _short(document)}
    )
    block, _ = blocks_of(page, "sh")
    check, run = (line.split()[1:] for line in block.strip().splitlines())
    workspace.environment |= {
        "XDG_STATE_HOME": str(folder / "state"),
        # As an installed command: the folder is not searched for modules.
        "PYTHONSAFEPATH": "1",
    }
    assert workspace.run(*check).count("in order") == 2
    workspace.run(*run, "--in-process", "--quiet", "--out", "calm")
    workspace.run(*run, "--workers", "2", "--quiet", "--out", "two")
    assert compare(folder / "calm", folder / "two") == []
    # As a kill leaves it: without the end of its journal.
    journal = folder / "two" / "journal.bin"
    journal.write_bytes(journal.read_bytes()[: journal.stat().st_size // 2])
    (folder / "two" / "state").write_text("running")
    shutil.rmtree(folder / "two" / "tables")
    (folder / "crowding.py").unlink()
    workspace.run("resume", "two", "--in-process", "--quiet")
    assert compare(folder / "calm", folder / "two") == []


def test_archive_of_the_selection_page_is_read_and_begins_a_run(
    workspace: Workspace,
) -> None:
    page = TOP / "docs" / "selection.md"
    _write(workspace, {"kinds.toml": _short(blocks_of(page, "toml")[2])})
    words = ("--seed", "0", "--births", "45", "--quiet", "--workers", "2")
    workspace.run("run", "kinds.toml", *words, "--out", "runs/kinds-seed0")
    block = blocks_of(page, "python")[2].replace("at=60", "at=30")
    told = workspace.python("-W", "error", "-c", block)
    assert len(told.splitlines()) > 5
    assert rv.Run(workspace.folder / "runs" / "kinds-seed0").archive(at=0) == []
    again = 'name = "again"\nbirths = 15\n[founders]\nrun = "runs/kinds-seed0"\n'
    _write(workspace, {"again.toml": f'{again}population = "archive"\n'})
    workspace.run("run", "again.toml", "--quiet", "--in-process", "--out", "again")
    origins = read_table(workspace.folder / "again", "births")["origin_birth"]
    held = archive_at(workspace.folder / "runs" / "kinds-seed0")
    fittest = sorted(held, key=lambda row: -row["fitness"])[:15]
    assert origins.to_pylist() == [row["birth"] for row in fittest]


def test_rule_of_the_selection_page_remembers_per_island_and_run(
    workspace: Workspace,
) -> None:
    """Equal alone, after another run in one process, and on two workers with a kill."""
    page, examples = TOP / "docs" / "selection.md", TOP / "docs" / "examples"
    files = {name: (examples / name).read_text() for name in NOVELTY}
    assert [blocks_of(page, kind)[1] for kind in ("python", "toml")] == [
        *files.values()
    ]
    folder = _write(workspace, files | {NOVELTY[1]: _short(files[NOVELTY[1]])})
    block = blocks_of(page, "sh")[1]
    check, run = (line.split()[1:] for line in block.strip().splitlines())
    assert workspace.run(*check).count("in order") == 3
    run += ["--births", "36", "--quiet"]
    workspace.run(*run, "--repeats", "2", "--in-process", "--out", "both")
    words = ("--repeats", "1", "--first-repeat", "1", "--workers", "1")
    workspace.run(*run, *words, "--out", "second")
    runs = [folder / "both" / f"novelty-{repeat}" for repeat in range(2)]
    assert compare(runs[1], folder / "second" / "novelty-1") == []
    killed = workspace.start(*run, "--workers", "2", "--out", "killed")
    journal = folder / "killed" / "journal.bin"
    half = (runs[0] / "journal.bin").stat().st_size // 2
    wait_until(lambda: journal.exists() and journal.stat().st_size > half, "half")
    killed.kill()
    killed.communicate()
    workspace.run("resume", "killed", "--workers", "1", "--quiet")
    assert compare(runs[0], folder / "killed") == []
    assert read_table(runs[0], "archive").num_rows > 1
    shared = files["novelty.py"].replace("\n\nclass", "\nARCHIVE = []\n\n\nclass", 1)
    text = "self.known: list[rv.Selectable] = []"
    _write(workspace, {"novelty.py": shared.replace(text, "self.known = ARCHIVE")})
    told = workspace.run(*run, "--in-process", "--out", "shared", code=2)
    assert told.endswith(f" {_quoted(page, 'selection.parents:')}\n")
    assert not (folder / "shared").exists()


@pytest.mark.slow
def test_measures_page_runs_from_top_to_bottom(workspace: Workspace) -> None:
    page = TOP / "docs" / "measures.md"
    module, *readers = blocks_of(page, "python")
    built_in, own = blocks_of(page, "toml")
    assert len(readers) >= 2
    _write(workspace, {"gaits.py": module, "gaits.toml": own})
    (block,) = blocks_of(page, "sh")
    _follow(workspace, block.splitlines())
    for reader in readers:
        workspace.python("-W", "error", "-c", reader)
    listed = re.findall(r"^\| `(\w+)` \| ", page.read_text(), re.MULTILINE)
    assert {*BUILT_IN} <= {*listed}
    measures = parse_experiment(built_in, str(page)).measures
    assert len(measures_of(measures)) == 5
    wrong = module.replace('@rv.needs("contact")\n', "\n")
    _write(workspace, {"gaits.py": wrong})
    quoted = _quoted(page, "measures.names:")
    assert quoted in workspace.run("check", "gaits.toml", code=1)


@pytest.mark.slow
def test_code_of_the_python_page_runs_from_top_to_bottom(workspace: Workspace) -> None:
    blocks = blocks_of(TOP / "docs" / "python.md", "python")
    assert len(blocks) >= 8
    told = workspace.python("-W", "error", "-c", "\n".join(blocks))
    assert "no such experiment; did you mean 'scenario1'" in told
    assert "\n20 of 20\n" in told


def test_experiments_of_the_experiments_page_run(workspace: Workspace) -> None:
    page = TOP / "docs" / "experiments.md"
    (module,) = blocks_of(page, "python")
    (yard,) = blocks_of(page, "xml")
    folder = _write(workspace, {"my_parts.py": module, "yard.xml": yard})
    documents = blocks_of(page, "toml")
    assert len(documents) >= 3
    for document in documents:
        # One pushes robots every three seconds.
        _write(workspace, {"mine.toml": _short(document, 4)})
        words = f"--births 20 --in-process --quiet --out out-{len(document)}"
        _follow(workspace, [f"revolve run mine.toml {words}"])
        if "my_parts" not in document:
            parse_experiment(document, str(folder / page.name))


def test_experiments_of_the_brains_page_run(workspace: Workspace) -> None:
    """Each runs equally in one process and with two workers."""
    write_module(workspace.folder)
    for document in blocks_of(TOP / "docs" / "brains.md", "toml"):
        _write(workspace, {"mine.toml": _short(document)})
        runs = [f"out-{len(document)}-{number}" for number in range(2)]
        words = "revolve run mine.toml --births 17 --quiet --out"
        hows = (f"{runs[0]} --in-process", f"{runs[1]} --workers 2")
        _follow(workspace, [f"{words} {how}" for how in hows])
        first, second = (workspace.folder / run for run in runs)
        assert compare(first, second) == []


def test_parts_page_runs(workspace: Workspace) -> None:
    page = TOP / "docs" / "parts.md"
    module, knees = blocks_of(page, "python")
    document, with_knees = blocks_of(page, "toml")
    (robot,) = blocks_of(page, "yaml")
    _write(
        workspace, {"my_parts.py": module, "mine.toml": document, "kneed.yaml": robot}
    )
    _write(workspace, {"knees.py": knees, "knees.toml": with_knees})
    (block,) = blocks_of(page, "sh")
    for told in _follow(workspace, block.splitlines()):
        printed = re.search(r"^fitness: +(\S+)", told, re.MULTILINE)
        assert not printed or 0.025 < float(printed[1]) < 0.035
    # The page gives the numbers of the built-in hinge.
    session: dict[str, PartType] = {}
    exec(knees, session)  # noqa: S102 - the page's own code
    knee = session["KNEE"]
    assert knee.shape(()) == ACTIVE_HINGE.shape(())
    assert knee.motor == ACTIVE_HINGE.motor
    words = ("run", "mine.toml", "--births", "20", "--in-process", "--quiet")
    workspace.run(*words, "--out", "out")
    axis = "length, 0.0, 0.0), ({}.0, 0.0, 0.0), ("
    wrong = module.replace(axis.format(1), axis.format(2))
    _write(workspace, {"my_parts.py": wrong})
    told = workspace.run(*words, "--out", "wrong", code=2)
    assert _quoted(page, "space.part_types:") in told


def test_experiments_of_the_tasks_page_are_accepted(tmp_path: Path) -> None:
    documents = blocks_of(TOP / "docs" / "tasks.md", "toml")
    assert len(documents) >= 5
    for document in documents:
        fitness = parse_experiment(document, str(tmp_path / "mine.toml")).fitness
        check_fitness(fitness)


def test_arenas_page_lists_all_keys_with_their_defaults() -> None:
    page = (TOP / "docs" / "arenas.md").read_text()
    listed = re.findall(r"^\| `(\w+)` \| (\S+) \|", page, re.MULTILINE)
    assert listed == [
        (name, str(value).lower())
        for name, value in msgspec.structs.asdict(ArenaSection()).items()
    ]


def test_commands_of_the_robots_page_run(workspace: Workspace) -> None:
    page = TOP / "docs" / "robots.md"
    (document,) = blocks_of(page, "toml")
    folder = _write(workspace, {"robogen.toml": document})
    block, drawing, packing = blocks_of(page, "sh")
    own = "revolve robot simulate some.yaml --experiment robogen.toml"
    lines = [*block.splitlines(), own]
    told = _follow(workspace, lines)
    # Without the line that says where the settings come from.
    printed = [
        text.partition("revolve: ")[0]
        for line, text in zip(lines, told, strict=True)
        if "simulate" in line
    ]
    assert printed[0] == printed[1]
    assert printed[2] != printed[0]
    assert (folder / "some.yaml").read_text() == (folder / "again.yaml").read_text()
    _follow(workspace, drawing.splitlines())
    shown = _follow(workspace, packing.splitlines())[3]
    assert re.match(r"birth 0:\d+ of run [0-9a-f]{12}, parents 0:", shown)


def test_archipelagos_of_the_islands_page_run(workspace: Workspace) -> None:
    page = TOP / "docs" / "islands.md"
    (document,) = blocks_of(page, "toml")
    _write(workspace, {"mine.toml": document})
    shipped = (SHIPPED / "archipelago-ring.toml").read_text()
    _write(workspace, {"ring.toml": _short(shipped)})
    block, groups, reading = (
        text.replace("run archipelago-ring", "run ring.toml")
        for text in blocks_of(page, "sh")
    )
    own = "revolve run mine.toml --births 24 --out mine"
    _follow(workspace, [own, *block.splitlines()])
    told = _follow(workspace, [*groups.splitlines(), *reading.splitlines()])
    assert told.count("equal in all repeatable columns\n") == 2


def test_campaign_of_the_campaigns_page_runs(workspace: Workspace) -> None:
    page = TOP / "docs" / "campaigns.md"
    block, export = blocks_of(page, "sh")
    *_, last = _follow(workspace, block.splitlines())
    assert "4 of 4 runs already finished" in last
    said = _follow(workspace, export.splitlines())
    assert all("of 4 runs" in each for each in (*said[:2], said[3]))
    for reader in blocks_of(page, "python"):
        workspace.python("-W", "error", "-c", reader)


def test_every_command_on_the_pages_exists() -> None:
    named = {
        word
        for page in PAGES
        for word in re.findall(
            r"(?<!import )(?<!from )\brevolve ([a-z]+)\b", page.read_text()
        )
    }
    assert len(named) >= 6
    assert named <= set(COMMANDS)
