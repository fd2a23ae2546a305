"""Runs the code of README and docs unchanged."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec
import pytest

from revolve.cli.commands import COMMANDS
from schema.experiment.document import ArenaSection
from schema.parts import ACTIVE_HINGE, PartType
from tests.documents import parse_experiment
from tests.own_brains import write_module
from worker.kinds import check_fitness
from worker.measures import BUILT_IN, measures_of

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

TOP = Path(__file__).parents[2]
PAGES = [TOP / "README.md", *sorted((TOP / "docs").glob("*.md"))]


def _blocks(page: Path, language: str) -> list[str]:
    return re.findall(
        rf"^```{language}\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL
    )


def _environment(*paths: Path) -> dict[str, str]:
    found = os.pathsep.join(map(str, (*paths, TOP)))
    return {**os.environ, "PYTHONPATH": found}


def _python(
    words: Sequence[str], folder: Path, *paths: Path
) -> subprocess.CompletedProcess[str]:
    """Run Python with arguments in a folder, as a reader would."""
    return subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env=_environment(*paths),
        capture_output=True,
        text=True,
        check=False,
    )


def _follow(
    lines: Iterable[str], folder: Path, *paths: Path
) -> list[subprocess.CompletedProcess[str]]:
    """Run commands one after the other; each has to succeed."""
    done = [_python(("-m", *line.partition("#")[0].split()), folder, *paths)
            for line in lines]  # fmt: skip
    for each in done:
        assert each.returncode == 0, f"{each.args}\n{each.stdout}{each.stderr}"
    return done


@pytest.mark.parametrize(
    ("page", "least"), [("tables.md", 5), ("analysis.md", 3), ("viewing.md", 0)]
)
def test_code_of_pages_about_tables_runs(
    page: str, least: int, undisturbed: Path, tmp_path: Path
) -> None:
    shutil.copytree(undisturbed, tmp_path / "runs" / "a")
    commands = [["-m", *block.split()]
                for block in _blocks(TOP / "docs" / page, "bash")]  # fmt: skip
    blocks = _blocks(TOP / "docs" / page, "python")
    assert len(blocks) >= least
    for words in [
        *commands,
        *(["-W", "error", "-c", block] for block in blocks),
    ]:
        done = _python(words, tmp_path)
        assert done.returncode == 0, f"{words[-1]}\n{done.stderr}"


def test_selection_of_the_selection_page_runs(tmp_path: Path) -> None:
    """Two workers give the births of one process; the run needs its folder alone."""
    page = TOP / "docs" / "selection.md"
    (module,) = _blocks(page, "python")
    (document,) = _blocks(page, "toml")
    plugin = tmp_path / "crowding.py"
    plugin.write_text(module)
    (tmp_path / "crowding.toml").write_text(document)
    (block,) = _blocks(page, "sh")
    check, run = (line.split()[1:] for line in block.strip().splitlines())
    environment = {
        **_environment(),
        "XDG_STATE_HOME": str(tmp_path / "state"),
        # As an installed command: the folder is not searched for modules.
        "PYTHONSAFEPATH": "1",
    }

    def revolve(*words: str) -> str:
        done = subprocess.run(
            [sys.executable, "-m", "revolve", *words],
            cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert revolve(*check).count("in order") == 2
    revolve(*run, "--in-process", "--quiet", "--out", "calm")
    revolve(*run, "--workers", "2", "--quiet", "--out", "two")
    assert "equal" in revolve("compare", "calm", "two")
    # As a kill leaves it: without the end of its journal.
    journal = tmp_path / "two" / "journal.bin"
    journal.write_bytes(journal.read_bytes()[: journal.stat().st_size // 2])
    (tmp_path / "two" / "state").write_text("running")
    shutil.rmtree(tmp_path / "two" / "tables")
    plugin.unlink()
    revolve("resume", "two", "--in-process", "--quiet")
    assert "equal" in revolve("compare", "calm", "two")


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_measures_page_runs_from_top_to_bottom(tmp_path: Path) -> None:
    page = TOP / "docs" / "measures.md"
    module, *readers = _blocks(page, "python")
    built_in, own = _blocks(page, "toml")
    assert len(readers) >= 2
    (tmp_path / "gaits.py").write_text(module)
    (tmp_path / "gaits.toml").write_text(own)
    (block,) = _blocks(page, "sh")
    _follow(block.splitlines(), tmp_path)
    for reader in readers:
        done = _python(("-W", "error", "-c", reader), tmp_path)
        assert done.returncode == 0, f"{reader}\n{done.stderr}"
    listed = re.findall(r"^\| `(\w+)` \| \S.*\| ", page.read_text(), re.MULTILINE)
    # The channel of the same name as a measure comes later.
    assert [name for name in dict.fromkeys(listed) if name in BUILT_IN] == [*BUILT_IN]
    measures = parse_experiment(built_in, str(page)).measures
    assert len(measures_of(measures)) == 5
    # The message that the page quotes.
    (tmp_path / "gaits.py").write_text(module.replace('@rv.needs("contact")\n', "\n"))
    done = _python(("-m", "revolve", "check", "gaits.toml"), tmp_path)
    (quoted,) = re.findall(
        r"^    (measures\.names: .*)$", page.read_text(), re.MULTILINE
    )
    assert done.returncode != 0
    assert quoted in done.stdout + done.stderr


@pytest.mark.slow
def test_code_of_the_python_page_runs_from_top_to_bottom(tmp_path: Path) -> None:
    blocks = _blocks(TOP / "docs" / "python.md", "python")
    assert len(blocks) >= 8
    done = _python(("-W", "error", "-c", "\n".join(blocks)), tmp_path)
    assert done.returncode == 0, done.stderr
    assert "no such experiment; did you mean 'scenario1'" in done.stdout
    assert "\n20 of 20\n" in done.stdout


def test_experiments_of_the_experiments_page_run(tmp_path: Path) -> None:
    page = TOP / "docs" / "experiments.md"
    (module,) = _blocks(page, "python")
    (tmp_path / "my_parts.py").write_text(module)
    (yard,) = _blocks(page, "xml")
    (tmp_path / "yard.xml").write_text(yard)
    documents = _blocks(page, "toml")
    assert len(documents) >= 3
    for document in documents:
        (tmp_path / "mine.toml").write_text(document)
        words = f"--births 20 --in-process --quiet --out out-{len(document)}"
        _follow([f"revolve run mine.toml {words}"], tmp_path, tmp_path)
        if "my_parts" not in document:
            parse_experiment(document, str(tmp_path / page.name))


def test_experiments_of_the_brains_page_run(tmp_path: Path) -> None:
    """Each runs equally in one process and with two workers."""
    write_module(tmp_path)
    for document in _blocks(TOP / "docs" / "brains.md", "toml"):
        (tmp_path / "mine.toml").write_text(document)
        runs = [f"out-{len(document)}-{number}" for number in range(2)]
        hows = ("--in-process", "--workers 2")
        words = "revolve run mine.toml --births 17 --quiet"
        commands = [
            f"{words} {how} --out {run}" for how, run in zip(hows, runs, strict=True)
        ]
        _follow([*commands, f"revolve compare {' '.join(runs)}"], tmp_path)


def test_parts_page_runs(tmp_path: Path) -> None:
    page = TOP / "docs" / "parts.md"
    module, knees = _blocks(page, "python")
    document, with_knees = _blocks(page, "toml")
    (robot,) = _blocks(page, "yaml")
    for name, text in (
        ("my_parts.py", module),
        ("mine.toml", document),
        ("knees.py", knees),
        ("knees.toml", with_knees),
        ("kneed.yaml", robot),
    ):
        (tmp_path / name).write_text(text)
    (block,) = _blocks(page, "sh")
    for done in _follow(block.splitlines(), tmp_path):
        printed = re.search(r"^fitness: +(\S+)", done.stdout, re.MULTILINE)
        assert not printed or 0.025 < float(printed[1]) < 0.035
    # The page gives the numbers of the built-in hinge.
    session: dict[str, PartType] = {}
    exec(knees, session)  # noqa: S102 - the page's own code
    knee = session["KNEE"]
    assert knee.shape(()) == ACTIVE_HINGE.shape(())
    assert knee.motor == ACTIVE_HINGE.motor
    words = "run mine.toml --births 20 --in-process --quiet --out out"
    _follow([f"revolve {words}"], tmp_path)
    # The message that the page quotes.
    wrong = module.replace(
        "length, 0.0, 0.0), (1.0, 0.0, 0.0), (", "length, 0.0, 0.0), (2.0, 0.0, 0.0), ("
    )
    (tmp_path / "my_parts.py").write_text(wrong)
    done = _python(("-m", "revolve", *words.split()), tmp_path)
    (quoted,) = re.findall(
        r"^    (space\.part_types: .*)$", page.read_text(), re.MULTILINE
    )
    assert done.returncode != 0
    assert quoted in done.stderr


def test_experiments_of_the_tasks_page_are_accepted(tmp_path: Path) -> None:
    documents = _blocks(TOP / "docs" / "tasks.md", "toml")
    assert len(documents) >= 5
    for document in documents:
        fitness = parse_experiment(document, str(tmp_path / "mine.toml")).fitness
        check_fitness(fitness)


def test_arenas_page_lists_all_keys_with_their_defaults() -> None:
    page = (TOP / "docs" / "arenas.md").read_text()
    listed = re.findall(r"^\| `(\w+)` \| (\S+) \|", page, re.MULTILINE)
    assert listed == [
        (field.name, str(field.default).lower())
        for field in msgspec.structs.fields(ArenaSection)
    ]


def test_commands_of_the_robots_page_run(tmp_path: Path) -> None:
    page = TOP / "docs" / "robots.md"
    (document,) = _blocks(page, "toml")
    (tmp_path / "robogen.toml").write_text(document)
    (block,) = _blocks(page, "sh")
    own = "revolve robot simulate some.yaml --experiment robogen.toml"
    done = _follow([*block.splitlines(), own], tmp_path)
    printed = [each.stdout for each in done if "simulate" in each.args]
    assert printed[0] == printed[1]
    assert printed[2] != printed[0]
    some, again = (tmp_path / name for name in ("some.yaml", "again.yaml"))
    assert some.read_text() == again.read_text()


def test_archipelagos_of_the_islands_page_run(tmp_path: Path) -> None:
    page = TOP / "docs" / "islands.md"
    (document,) = _blocks(page, "toml")
    (tmp_path / "mine.toml").write_text(document)
    (block,) = _blocks(page, "sh")
    own = "revolve run mine.toml --births 24 --out mine"
    _follow([own, *block.splitlines()], tmp_path)


def test_campaign_of_the_campaigns_page_runs(tmp_path: Path) -> None:
    (block,) = _blocks(TOP / "docs" / "campaigns.md", "sh")
    *_, last = _follow(block.splitlines(), tmp_path)
    assert "4 of 4 runs already finished" in last.stderr


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


def test_every_link_has_a_target() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name}: {target}"
