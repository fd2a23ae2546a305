"""Checks of plug-ins: each fault is one line with key, file, line and expectation."""

import io
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from coordinator.__main__ import plugin_kinds
from coordinator.plugins.checks import check_apart, check_here, refuse_faulty
from coordinator.storage.campaign import read_drafts
from schema.errors import ExperimentError
from schema.plugins import permission
from tests.own_brains import write_module

Steps = list[tuple[str, str]]

CRITTERS = Path(__file__).parents[2] / "plugins" / "critters_lab" / "critters"
GOOD = """
from worker.fitness import straight_velocity

def judge(track, fitness):
    return -straight_velocity(track)
"""


pytestmark = pytest.mark.usefixtures("_nothing_allowed")


@pytest.fixture
def lab(tmp_path: Path) -> Callable[[str], Path]:
    """Return a function that writes a plug-in file with a name of its own."""

    def write(text: str) -> Path:
        # Modules stay imported, so each test has its own.
        file = tmp_path / f"{tmp_path.name.replace('-', '_')}.py"
        file.write_text(text)
        return file

    return write


def checked(*words: str, kind: str | None = None) -> Steps:
    output = io.StringIO()
    check_here(words, plugin_kinds(), kind, output, 30.0)
    return [tuple(json.loads(line)) for line in output.getvalue().splitlines()]


def test_a_fitness_function_is_recognised_and_in_order(
    lab: Callable[[str], Path],
) -> None:
    file = lab(GOOD)
    path = f"{file.stem}:judge"
    assert checked(f"{file}:judge") == [
        ("begin", f"{file}:judge"),
        ("begin", f"fitness.function: {path}"),
        ("begin", f"fitness.function: {file.name}:4"),
        ("fine", f"{path}: fitness at {file.name}:4: in order"),
    ]


def test_a_part_type_is_recognised() -> None:
    (*_, (step, text)) = checked("schema.parts:HINGE")
    assert step == "fine"
    assert re.search(r"part-type at parts\.py:\d+: in order", text)


def test_a_part_that_is_never_attached_to_an_unknown_one_makes_a_warning(
    lab: Callable[[str], Path], tmp_path: Path
) -> None:
    file = lab("""
from dataclasses import replace

from schema.parts import HINGE

FIN = replace(HINGE, name="Fin", not_on=("ActiveHing", "Hinge"))
""")
    document = tmp_path / "fins.toml"
    parts = f'"schema.parts:CORE", "schema.parts:ACTIVE_HINGE", "{file.stem}:FIN"'
    document.write_text(f'name = "fins"\n[space]\npart_types = [{parts}]\n')
    (warning,) = [text for step, text in checked(str(document)) if step == "warn"]
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


FAULTS = {
    "arity": ("def f():\n    return 1.0", "f", "FILE.py:1: must be of one of the"),
    "raising": (
        "def f(a, b):\n    c = 0\n    return 1 / c",
        "f",
        r"FILE.py:1: raised ZeroDivisionError: .* \(FILE.py:3\)",
    ),
    "exiting": (
        "import sys\ndef f(a, b):\n    sys.exit(3)",
        "f",
        r"FILE.py:2: raised SystemExit: 3 \(FILE.py:3\)",
    ),
    "import": ("a = 1\nb = a / 0", "f", "FILE.py:2: .*ZeroDivisionError"),
    "import-exits": ("\nexit(4)", "f", "FILE.py:2: .*SystemExit: 4"),
    "syntax": ("def f(:\n", "f", "SyntaxError: .*FILE.py, line 1"),
    "number": ("f = 3", "f", "must be of one of the kinds .*, got a int"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_one_line(lab: Callable[[str], Path], fault: str) -> None:
    text, name, expected = FAULTS[fault]
    file = lab(text)
    step, line = checked(f"{file}:{name}")[-1]
    assert step == "fault"
    assert "\n" not in line
    pattern = expected.replace("FILE.py", re.escape(file.name))
    assert re.search(pattern, line), line


def test_a_plug_in_that_is_named_twice_is_told_once(lab: Callable[[str], Path]) -> None:
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


def test_experiment_without_own_plug_ins_is_in_order(tmp_path: Path) -> None:
    document = tmp_path / "small.toml"
    document.write_text('name = "small"\nbirths = 20\n')
    lines: list[str] = []
    assert check_apart(["scenario1", str(document)], lines.append) == []
    assert lines == [
        "scenario1: in order, no plug-ins of its own",
        f"{document}: in order, no plug-ins of its own",
    ]


@pytest.mark.parametrize(
    ("tables", "fault"),
    [
        ('[fitness]\nfunction = "lab.walk"', "fitness.function: must be one of "),
        ('[measures]\nnames = ["straight_speed"]', "mean 'straight_velocity'"),
        ('[encoding]\ntype = "cppnn"', "encoding.type: .* mean 'cppn'"),
        ('[learning]\nlearner = "cma"', "learning.learner: must be one of "),
        ('[brain]\ntype = "rnn"', "brain.type: must be one of "),
    ],
)
def test_unknown_built_in_plug_in_is_a_fault(
    tmp_path: Path, tables: str, fault: str
) -> None:
    document = tmp_path / "odd.toml"
    document.write_text(f'name = "odd"\nbirths = 20\n{tables}\n')
    (problem,) = check_apart([str(document)])
    assert re.search(rf"^{re.escape(str(document))}: .*{fault}", problem)


def test_file_of_another_folder_may_have_the_name_of_one_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there = tmp_path / "there"
    there.mkdir()
    (there / "walk.py").write_text(GOOD)
    (tmp_path / "walk.py").write_text("raise NotImplementedError\n")
    monkeypatch.chdir(tmp_path)
    assert check_apart(["there/walk.py:judge"]) == []


def test_own_encoding_of_islands_is_in_order(tmp_path: Path) -> None:
    shutil.copy(CRITTERS / "genomes.py", tmp_path)
    document = tmp_path / "sea.toml"
    document.write_text(
        'name = "sea"\nbirths = 20\n[encoding]\ntype = "genomes:Snakes"\n'
        "[migration]\ntopology = 'ring'\nepoch = 5\n[[islands]]\ncount = 2\n"
    )
    assert check_apart([str(document)]) == []


def test_what_is_wrong_elsewhere_is_no_fault_of_an_encoding(tmp_path: Path) -> None:
    shutil.copy(CRITTERS / "genomes.py", tmp_path)
    document = tmp_path / "late.toml"
    document.write_text(
        'name = "late"\n[encoding]\ntype = "genomes:Snakes"\n'
        "[simulation]\nwindow_steps = 400\n[environment]\npush_impulse = 0.001\n"
    )
    (problem,) = check_apart([str(document)])
    expected = r"late\.toml: late: environment\.push_interval_s: must be < 2 s"
    assert re.match(expected, problem), problem


def test_name_that_no_folder_can_have_is_a_fault(tmp_path: Path) -> None:
    document = tmp_path / "odd.toml"
    document.write_text('name = "a/b"\nbirths = 20\n')
    (problem,) = check_apart([str(document)])
    assert problem.startswith(f"{document}: name: must have no '/'")


def test_file_without_a_name_is_asked_for_one(lab: Callable[[str], Path]) -> None:
    file = lab(GOOD)
    step, line = checked(str(file))[-1]
    assert (step, line) == (
        "fault",
        f"{file}: name a function or class: {file}:NAME",
    )


def test_kind_may_be_said(lab: Callable[[str], Path]) -> None:
    file = lab("def f(a):\n    return 1.0")
    step, line = checked(f"{file}:f", kind="fitness")[-1]
    assert step == "fault"
    wanted = "must take 2 arguments (trace, parameters), this one takes 1 (a)"
    assert line.endswith(f"{file.name}:1: '{file.stem}:f' {wanted}")


def test_plug_in_that_prints_does_not_disturb_the_report(
    lab: Callable[[str], Path],
) -> None:
    file = lab("def f(a, b):\n    print('hello')\n    return 1.0")
    assert checked(f"{file}:f")[-1][0] == "fine"


def test_check_of_a_module_that_never_ends_ends(lab: Callable[[str], Path]) -> None:
    file = lab("import time\ntime.sleep(60)")
    good: list[str] = []
    words = ["worker.fitness:thesis", f"{file}:f"]
    (line,) = check_apart(words, good.append, limit_s=1.0)
    expected = rf":f: must take at most 1 s, but was still at {file.name}:2"
    assert re.search(expected, line), line
    assert len(good) == 1


def test_experiment_is_refused_before_its_plug_ins_are_imported_here(
    tmp_path: Path,
) -> None:
    (tmp_path / "refused_lab.py").write_text("def f(a, b):\n    return a\n")
    document = tmp_path / "mine.toml"
    document.write_text('name = "x"\n[fitness]\nfunction = "refused_lab:f"\n')
    expected = r"^fitness\.function: refused_lab\.py:1: must return a number, got Tr"
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
    lab: Callable[[str], Path], tmp_path: Path, tables: str, expected: str
) -> None:
    file = lab(
        "from msgspec import Struct\n\n\nclass Own(Struct):\n    height_m: float\n"
        "    friction: float = 1.0\n\n\ndef judge(trace, own: Own):\n"
        "    return own.height_m\n"
    )
    document = tmp_path / "mine.toml"
    document.write_text(
        f'name = "x"\n[fitness]\nfunction = "{file.stem}:judge"\n{tables}\n'
    )
    step, line = checked(str(document))[-1]
    assert step == "fault"
    assert re.match(expected, line), line


def test_a_key_of_fitness_without_effect_is_refused(
    lab: Callable[[str], Path], tmp_path: Path
) -> None:
    file = lab("def judge(track, fitness):\n    return min(1.0, fitness.limit)\n")
    document = tmp_path / "mine.toml"
    for function, key, why in (
        (f"{file.stem}:judge", "limit", ""),
        (f"{file.stem}:judge", "path_weight", "which does not read it"),
        ("locomotion", "straight_weight", ""),
        ("balance", "limit", r"which reads \[fitness\.parameters\]"),
    ):
        document.write_text(
            f'name = "x"\n[fitness]\nfunction = "{function}"\n{key} = 2.0\n'
        )
        step, line = checked(str(document))[-1]
        assert step == ("fault" if why else "fine"), line
        assert re.search(why, line)
        assert not why or line.startswith(f"{document}: fitness.")


def test_births_outside_the_wall_are_refused(tmp_path: Path) -> None:
    document = tmp_path / "mine.toml"
    for wall, why in (
        ("wall_diameter_m = 3.0", "less than half of wall_diameter_m, 1.5 m"),
        ("wall_diameter_m = 3.0\nbirth_radius_m = 1.5", "1.5 m, as .*; got 1.5"),
        ("wall_diameter_m = 3.0\nbirth_radius_m = 1.4", ""),
        ("birth_radius_m = 9.0", ""),
    ):
        document.write_text(
            f'name = "x"\n[[islands]]\n[[islands]]\n[islands.arena]\n{wall}\n'
        )
        step, line = checked(str(document))[-1]
        assert step == ("fault" if why else "fine"), line
        assert re.search(why, line)


def test_inherited_parameters_of_an_island_are_explained(
    lab: Callable[[str], Path], tmp_path: Path
) -> None:
    file = lab(
        "import msgspec\nclass P(msgspec.Struct):\n    a: float = 1.0\n"
        "def judge(track, parameters: P):\n    return parameters.a\n"
    )
    document = tmp_path / "mine.toml"
    for own, is_fine in (("", False), ("parameters = {}", True)):
        document.write_text(
            f'name = "x"\n[fitness]\nfunction = "{file.stem}:judge"\n'
            "[fitness.parameters]\na = 2.0\n[[islands]]\n[[islands]]\n"
            f'[islands.fitness]\nfunction = "locomotion"\n{own}\n'
        )
        step, line = checked(str(document))[-1]
        assert step == ("fine" if is_fine else "fault"), line
        assert is_fine or line.endswith(
            "'parameters = {}' in [islands.fitness] replaces those of [fitness]"
        )


def test_selection_gets_the_measures_that_the_experiment_records(
    lab: Callable[[str], Path], tmp_path: Path
) -> None:
    file = lab(
        "def keep(population, count, rng, parameters):\n"
        "    heights = [-one.measures['height'] for one in population]\n"
        "    return sorted(range(len(heights)), key=heights.__getitem__)[:count]\n"
    )
    document = tmp_path / "mine.toml"
    own = f'name = "x"\n[selection]\nsurvivors = "{file.stem}:keep"\n'
    document.write_text(own)
    step, line = checked(str(document))[-1]
    assert (step, "raised KeyError: 'height'" in line) == ("fault", True), line
    document.write_text(f'{own}[measures]\nnames = ["height"]\n')
    found = dict(checked(str(document)))
    assert "in order" in found["fine"]
    # It is no fault: perhaps no robot of a run fails.
    assert "of a population with failed robots (fitness 0, no" in found["warn"]


def test_check_refuses_what_a_run_would_refuse(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The current folder holds a module that hides one of the standard library."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "random.py").write_text("raise SystemExit(7)\n")
    (tmp_path / "mine.toml").write_text(
        'name = "mine"\n[space]\nmin_parts = 20\nmax_parts = 4\n'
    )
    (problem,) = check_apart([str(tmp_path / "mine.toml")])
    assert "min_parts" in problem
    assert "in order" not in problem
