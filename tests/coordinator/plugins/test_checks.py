"""Checks of plug-ins: each fault is one line with key, file, line and expectation."""

import io
import json
import re
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from coordinator.__main__ import plugin_kinds
from coordinator.plugins.checks import check_apart, check_here, refuse_faulty
from coordinator.storage.campaign import read_drafts
from schema.errors import ExperimentError
from schema.plugins import permission
from tests.own_brains import write_module

Writer = Callable[[str], Path]
Steps = list[tuple[str, str]]

CRITTERS = Path(__file__).parents[2] / "plugins" / "critters_lab" / "critters"
GOOD = """
from worker.fitness import straight_velocity

def judge(track, fitness):
    return -straight_velocity(track)
"""


pytestmark = pytest.mark.usefixtures("_nothing_allowed")


@pytest.fixture
def lab(tmp_path: Path) -> Writer:
    """Return a function that writes a plug-in file with a name of its own."""

    def write(text: str) -> Path:
        # Modules stay imported, so each test has its own.
        file = tmp_path / f"{tmp_path.name.replace('-', '_')}.py"
        file.write_text(text)
        return file

    return write


@pytest.fixture
def experiment(tmp_path: Path) -> Writer:
    """Return a function that writes an experiment of some sections."""

    def write(sections: str) -> Path:
        document = tmp_path / "mine.toml"
        document.write_text(f'name = "x"\n{sections}\n')
        return document

    return write


def checked(*words: object, kind: str | None = None) -> Steps:
    output = io.StringIO()
    check_here([*map(str, words)], plugin_kinds(), kind, output, 30.0)
    return [tuple(json.loads(line)) for line in output.getvalue().splitlines()]


def last(word: object, why: str, kind: str | None = None) -> str:
    """Return the last line about a word: a fault with a reason, or none."""
    step, line = checked(word, kind=kind)[-1]
    assert step == ("fault" if why else "fine"), line
    assert re.search(why, line), line
    assert "\n" not in line
    return line


def test_a_fitness_function_is_recognised_and_in_order(lab: Writer) -> None:
    file = lab(GOOD)
    path = f"{file.stem}:judge"
    assert checked(f"{file}:judge") == [
        ("begin", f"{file}:judge"),
        ("begin", f"fitness.function: {path}"),
        ("begin", f"fitness.function: {file.name}:4"),
        ("fine", f"{path}: fitness at {file.name}:4: in order"),
    ]


def test_a_part_type_is_recognised() -> None:
    line = last("schema.parts:HINGE", "")
    assert re.search(r"part-type at parts\.py:\d+: in order", line)


def test_a_part_that_is_never_attached_to_an_unknown_one_makes_a_warning(
    lab: Writer, experiment: Writer
) -> None:
    file = lab(
        "from dataclasses import replace\nfrom schema.parts import HINGE\n"
        'FIN = replace(HINGE, name="Fin", not_on=("ActiveHing", "Hinge"))\n'
    )
    types = ["schema.parts:CORE", "schema.parts:ACTIVE_HINGE", f"{file.stem}:FIN"]
    document = experiment(f"[space]\npart_types = {types}")
    (warning,) = [text for step, text in checked(document) if step == "warn"]
    assert warning == (
        f"{document}: warning: space.part_types: Fin.not_on: no part type is named "
        "'ActiveHing'; did you mean 'ActiveHinge'?"
    )


def test_neuron_and_brain_types_are_recognised(tmp_path: Path) -> None:
    file = write_module(tmp_path)
    found = checked(f"{file}:Adapting", f"{file}:Wave")
    neuron, brain = [text for step, text in found if step == "fine"]
    assert re.fullmatch(r"my_brains:Adapting: neuron-type at .*:\d+: in order", neuron)
    assert re.fullmatch(r"my_brains:Wave: brain at my_brains.py:\d+: in order", brain)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("def f():\n    return 1.0", "FILE.py:1: must be of one of the"),
        ("def f(a, b):\n    c = 0\n    return 1 / c", "FILE.py:1: .*Zero.*FILE.py:3"),
        ("import sys\ndef f(a, b):\n    sys.exit(3)", "FILE.py:2: .*: 3 .FILE.py:3"),
        ("a = 1\nb = a / 0", "FILE.py:2: .*ZeroDivisionError"),
        ("\nexit(4)", "FILE.py:2: .*SystemExit: 4"),
        ("def f(:\n", "SyntaxError: .*FILE.py, line 1"),
        ("f = 3", "must be of one of the kinds .*, got a int"),
    ],
)
def test_each_fault_is_one_line(lab: Writer, text: str, expected: str) -> None:
    file = lab(text)
    last(f"{file}:f", expected.replace("FILE.py", re.escape(file.name)))


def test_a_plug_in_that_is_named_twice_is_told_once(lab: Writer) -> None:
    file = lab("""def f(population, rng, parameters):
    if sum(one.fitness == -1.0 for one in population) > 10:
        raise ValueError("a failed robot")
    return 0, 1
""")
    lines: list[str] = []
    warnings: list[str] = []
    words = [f"{file}:f", f"{file}:f"]
    assert check_apart(words, lines.append, warn=warnings.append) == []
    assert lines == [f"{file.stem}:f: parents at {file.name}:1: in order"]
    assert len(warnings) == 1


def test_experiment_without_own_plug_ins_is_in_order(experiment: Writer) -> None:
    words = ["scenario1", str(experiment("births = 20"))]
    lines: list[str] = []
    assert check_apart(words, lines.append) == []
    assert lines == [f"{word}: in order, no plug-ins of its own" for word in words]


LATE_PUSH = """encoding.type = "genomes:Snakes"
simulation.window_steps = 400
environment.push_impulse = 0.1"""


@pytest.mark.parametrize(
    ("sections", "fault"),
    [
        ('[fitness]\nfunction = "lab.walk"', "fitness.function: must be one of "),
        ('[measures]\nnames = ["straight_speed"]', "mean 'straight_velocity'"),
        ('[encoding]\ntype = "cppnn"', "encoding.type: .* mean 'cppn'"),
        ('[brain]\ntype = "rnn"', "brain.type: must be one of "),
        ("[space]\nmin_parts = 20\nmax_parts = 4", "min_parts"),
        (LATE_PUSH, "environment.push_interval_s: must be < 2 s"),
    ],
)
def test_check_refuses_what_a_run_would_refuse(
    experiment: Writer, sections: str, fault: str
) -> None:
    """Also what is wrong beside an encoding that is in order."""
    document = experiment(sections)
    shutil.copy(CRITTERS / "genomes.py", document.parent)
    (problem,) = check_apart([str(document)])
    assert re.search(fault, problem), problem
    assert "mine.toml: " in problem


def test_file_of_another_folder_may_have_the_name_of_one_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there = tmp_path / "there"
    there.mkdir()
    (there / "walk.py").write_text(GOOD)
    (tmp_path / "walk.py").write_text("raise NotImplementedError\n")
    monkeypatch.chdir(tmp_path)
    assert check_apart(["there/walk.py:judge"]) == []


def test_own_encoding_of_islands_is_in_order(experiment: Writer) -> None:
    document = experiment(
        'births = 20\n[encoding]\ntype = "genomes:Snakes"\n'
        "[migration]\ntopology = 'ring'\nepoch = 5\n[[islands]]\ncount = 2\n"
    )
    shutil.copy(CRITTERS / "genomes.py", document.parent)
    assert check_apart([str(document)]) == []


def test_name_that_no_folder_can_have_is_a_fault(tmp_path: Path) -> None:
    document = tmp_path / "odd.toml"
    document.write_text('name = "a/b"\nbirths = 20\n')
    (problem,) = check_apart([str(document)])
    assert problem.startswith(f"{document}: name: must have no '/'")


def test_file_without_a_name_is_asked_for_one(lab: Writer) -> None:
    file = lab(GOOD)
    assert last(file, "name") == f"{file}: name a function or class: {file}:NAME"


def test_kind_may_be_said(lab: Writer) -> None:
    file = lab("def f(a):\n    return 1.0")
    wanted = r"must take 2 arguments \(trace, parameters\), this one takes 1 \(a\)$"
    last(f"{file}:f", f"{file.name}:1: '{file.stem}:f' {wanted}", kind="fitness")


def test_plug_in_that_prints_does_not_disturb_the_report(lab: Writer) -> None:
    file = lab("def f(a, b):\n    print('hello')\n    return 1.0")
    last(f"{file}:f", "")


@pytest.mark.parametrize(
    ("code", "limit_s"), [("time.sleep(60)", 0.5), ("while True: pass", 1.0)]
)
def test_check_of_a_module_that_never_ends_ends(
    lab: Writer, code: str, limit_s: float
) -> None:
    file = lab(f"import time\n{code}")
    good: list[str] = []
    words = ["worker.fitness:thesis", f"{file}:f"]
    begun_s = time.monotonic()
    (line,) = check_apart(words, good.append, limit_s=limit_s)
    most = f"{limit_s:g} s of CPU time, and {4 * limit_s:g} s in all"
    expected = rf":f: must take at most {most}, but was still at {file.name}:2"
    assert re.search(expected, line), line
    assert len(good) == 1
    assert time.monotonic() - begun_s < 30.0


def test_machine_that_is_busy_with_something_else_is_no_fault(lab: Writer) -> None:
    """Limits are of CPU time: here, a wait stands for other processes' turns."""
    file = lab("import time\ntime.sleep(1.5)\ndef f(a, b):\n    return 1.0")
    assert check_apart([f"{file}:f"], limit_s=1.0) == []


def test_experiment_is_refused_before_its_plug_ins_are_imported_here(
    lab: Writer, experiment: Writer
) -> None:
    file = lab("def f(a, b):\n    return a\n")
    document = experiment(f'[fitness]\nfunction = "{file.stem}:f"')
    expected = rf"^fitness\.function: {file.name}:1: must return a number, got Tr"
    with pytest.raises(ExperimentError, match=expected):
        refuse_faulty(read_drafts(["scenario1", str(document)]))
    assert permission.allowed() == ()


@pytest.mark.parametrize(
    ("tables", "expected"),
    [
        ("[fitness.parameters]\nheigth_m = 0.2", "mine.toml:5: .*heigth_m: no such"),
        ("[fitness.parameters]\nheight_m = true", "mine.toml:5: .*must be a number"),
        ("", r"mine.toml: fitness.parameters: .*height_m"),
        # Another section has the key: no line is named.
        (
            "[fitness.parameters]\nfriction = true\n[simulation]\nfriction = 0.5",
            "mine.toml: fitness.parameters.friction: must be",
        ),
    ],
)
def test_a_wrong_parameter_is_placed_in_the_experiment(
    lab: Writer, experiment: Writer, tables: str, expected: str
) -> None:
    file = lab(
        "from msgspec import Struct\n\n\nclass Own(Struct):\n    height_m: float\n"
        "    friction: float = 1.0\n\n\ndef judge(trace, own: Own):\n"
        "    return own.height_m\n"
    )
    document = experiment(f'[fitness]\nfunction = "{file.stem}:judge"\n{tables}')
    last(document, f"^{expected}")


def test_a_key_of_fitness_without_effect_is_refused(
    lab: Writer, experiment: Writer
) -> None:
    file = lab("def judge(track, fitness):\n    return min(1.0, fitness.limit)\n")
    for function, key, why in (
        (f"{file.stem}:judge", "limit", ""),
        (f"{file.stem}:judge", "path_weight", "fitness.*, which does not read it"),
        ("locomotion", "straight_weight", ""),
        ("balance", "limit", r"fitness.*, which reads \[fitness\.parameters\]"),
    ):
        last(experiment(f'[fitness]\nfunction = "{function}"\n{key} = 2.0'), why)


def test_births_outside_the_wall_are_refused(experiment: Writer) -> None:
    for wall, why in (
        ("wall_diameter_m = 3.0", "less than half of wall_diameter_m, 1.5 m"),
        ("wall_diameter_m = 3.0\nbirth_radius_m = 1.5", "1.5 m, as .*; got 1.5"),
        ("wall_diameter_m = 3.0\nbirth_radius_m = 1.4", ""),
        ("birth_radius_m = 9.0", ""),
    ):
        last(experiment(f"[[islands]]\n[[islands]]\n[islands.arena]\n{wall}"), why)


def test_inherited_parameters_of_an_island_are_explained(
    lab: Writer, experiment: Writer
) -> None:
    file = lab(
        "import msgspec\nclass P(msgspec.Struct):\n    a: float = 1.0\n"
        "def judge(track, parameters: P):\n    return parameters.a\n"
    )
    hint = r"'parameters = {}' in \[islands.fitness\] replaces those of \[fitness\]$"
    for own, why in (("", hint), ("parameters = {}", "")):
        document = experiment(
            f'[fitness]\nfunction = "{file.stem}:judge"\n'
            "[fitness.parameters]\na = 2.0\n[[islands]]\n[[islands]]\n"
            f'[islands.fitness]\nfunction = "locomotion"\n{own}'
        )
        last(document, why)


def test_selection_gets_the_measures_that_the_experiment_records(
    lab: Writer, experiment: Writer
) -> None:
    file = lab(
        "def keep(population, count, rng, parameters):\n"
        "    heights = [-one.measures['height'] for one in population]\n"
        "    return sorted(range(len(heights)), key=heights.__getitem__)[:count]\n"
    )
    own = f'[selection]\nsurvivors = "{file.stem}:keep"\n'
    last(experiment(own), "raised KeyError: 'height'")
    steps = dict(checked(experiment(f'{own}[measures]\nnames = ["height"]')))
    assert "in order" in steps["fine"]
    # It is no fault: perhaps no robot of a run fails.
    assert "of a population with failed robots (fitness 0, no" in steps["warn"]


def test_the_current_folder_hides_no_module_of_the_standard_library(
    experiment: Writer, monkeypatch: pytest.MonkeyPatch
) -> None:
    document = experiment("births = 20")
    monkeypatch.chdir(document.parent)
    (document.parent / "random.py").write_text("raise SystemExit(7)\n")
    assert check_apart([str(document)]) == []
