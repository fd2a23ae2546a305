"""Loading of plug-ins by name: only allowed modules, only objects of one kind."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from schema.errors import ExperimentError, PluginDiffers, UnknownPlugin
from schema.experiment.document import Fitness, body_space
from schema.experiment.file import read_experiment
from schema.experiment.settings import (
    breeding_settings,
    evaluation_settings,
    fitness_function,
    read_breeding_settings,
    read_evaluation_settings,
)
from schema.parts import BUILT_IN, PartType
from schema.plugins import permission
from schema.plugins.load import load_function, load_object
from schema.plugins.permission import allow, allowed
from schema.plugins.source import check_plugins, forget_digests, plugins_of
from tests.documents import parse_experiment

FITNESS = "def fitness(track, settings):\n    return 1.0\n"


def load(path: str) -> PartType:
    return load_object(path, "key", {}, kind=PartType)


pytestmark = pytest.mark.usefixtures("_nothing_allowed")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder of installed modules."""
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def test_built_ins_are_loaded_like_plug_ins() -> None:
    assert load("schema.parts:HINGE") is BUILT_IN["Hinge"]


@pytest.mark.parametrize(
    ("path", "message"),
    [
        *((path, "must be 'module:attribute', got") for path in (
            "", "schema.parts", ":HINGE", "schema.parts:", "a b", "", ".:X",
            "..parts:X", ".parts:X", "schema..parts:X", "a\0b:X",
        )),
        ("is_there.no:X", r"'is_there\.no:X': No module"),
        ("schema.parts:HINGEE", r"did you mean 'schema\.parts:HINGE'"),
        ("schema.parts:zzzzzz", r"has no 'zzzzzz'$"),
        # A name that the module imports is no hint.
        ("schema.parts:dataclas", r"has no 'dataclas'$"),
        ("schema.parts:SERVO", "is not a PartType, but a Motor"),
    ],
)  # fmt: skip
def test_wrong_names_are_refused(folder: Path, path: str, message: str) -> None:
    (folder / "is_there.py").write_text("")
    allow(["is_there"])
    with pytest.raises(ExperimentError, match=f"key: .*{message}"):
        load(path)


@pytest.mark.parametrize("text", ["1 +", "1 / 0"])
def test_module_that_raises_on_import_is_an_experiment_error(
    text: str, own_module: Callable[[str], str]
) -> None:
    name = own_module(text)
    with pytest.raises(ExperimentError, match=rf"key: ({name}\.py:1: )?'{name}:X': "):
        load(f"{name}:X")


@pytest.mark.parametrize(
    "path",
    ["builtins:print", "os:system", "subprocess:Popen", "numpy:add", "schema.errors:x"],
)
def test_request_names_a_module_that_nobody_allowed(path: str) -> None:
    refusal = f"module {path.partition(':')[0]!r} is not allowed"
    document = read_experiment("scenario1")
    settings = evaluation_settings(document).replace(
        b"worker.fitness:thesis", path.encode()
    )
    with pytest.raises(UnknownPlugin, match=refusal):
        fitness_function(read_evaluation_settings(settings).fitness)
    bodies = breeding_settings(document).replace(b"schema.parts:CORE", path.encode())
    with pytest.raises(UnknownPlugin, match=refusal):
        body_space(read_breeding_settings(bodies).space)


def test_settings_of_a_request_are_within_the_limits_of_an_experiment() -> None:
    settings = evaluation_settings(read_experiment("scenario1"))
    ground = b'"roughness_m":0.1,"patch_m":1e-9'
    rough = settings.replace(b'"roughness_m":0.0,"patch_m":0.1', ground)
    assert rough != settings
    with pytest.raises(ExperimentError, match=r"of a request: .*patch_m: must"):
        read_evaluation_settings(rough)
    with pytest.raises(ExperimentError, match="must have <= 4000000 bytes"):
        read_evaluation_settings(settings + b" " * 4_000_000)


def test_module_that_is_not_allowed_is_not_imported(folder: Path) -> None:
    (folder / "parent_pkg").mkdir()
    mark = "open(__file__ + '.ran', 'w').close()\n"
    (folder / "parent_pkg" / "__init__.py").write_text(mark)
    (folder / "parent_pkg" / "child.py").write_text(mark + FITNESS)
    for wanted in ("parent_pkg=1", "parent_pkg.child=1", "parent_pkg.child.x=1"):
        with pytest.raises(PluginDiffers, match="has no plug-in 'parent_pkg"):
            check_plugins(wanted)
    with pytest.raises(UnknownPlugin, match=r"add --plugins parent_pkg\.child"):
        load_function("parent_pkg.child:fitness", "key", 2)
    plugins_of(b'["parent_pkg.child:fitness"]')
    allow(["parent_pkg.child"])
    with pytest.raises(PluginDiffers, match="differs"):
        check_plugins("parent_pkg=1")
    with pytest.raises(PluginDiffers, match="has no plug-in"):
        check_plugins("parent_pkg.child=1")
    assert not list(folder.rglob("*.ran"))
    load_function("parent_pkg.child:fitness", "key", 2)
    assert len(list(folder.rglob("*.ran"))) == 2


def test_advice_names_the_file_of_a_module_that_is_not_installed(
    folder: Path,
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (folder / "installed_advice.py").write_text("")
    here = tmp_path_factory.mktemp("here")
    (here / "here_advice.py").write_text("")
    monkeypatch.chdir(here)
    monkeypatch.syspath_prepend(here)
    for module, entry in (
        ("installed_advice", "installed_advice"),
        ("here_advice", "here_advice.py"),
        ("elsewhere_advice", "PATH/elsewhere_advice.py"),
    ):
        with pytest.raises(PluginDiffers, match=rf"; if .*, add --plugins {entry}$"):
            check_plugins(f"{module}=1234")


def test_list_of_plug_ins_is_limited_before_it_is_read() -> None:
    with pytest.raises(PluginDiffers, match="must have <= 10000 characters, got 10001"):
        check_plugins("a" * 10_001)
    with pytest.raises(PluginDiffers) as caught:
        check_plugins("a" * 10_000)
    assert len(str(caught.value)) < 11_000


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("from os import system as fitness", "is defined in posix, which is not"),
        ("from subprocess import Popen as fitness", "is not a function"),
        ("fitness = print", "is defined in builtins, which is not"),
        ("fitness = 3", "is not a function"),
        ("def fitness(track): return 1.0", "must take 2 arguments"),
        ("def fitness(a, b, c): return 1.0", "must take 2 arguments"),
        ("class fitness: pass", "is not a function"),
    ],
)
def test_fitness_is_a_function_of_its_own_module(
    own_module: Callable[[str], str], text: str, message: str
) -> None:
    name = own_module(text)
    with pytest.raises(ExperimentError, match=f"{name}:fitness' {message}"):
        fitness_function(Fitness(function=f"{name}:fitness"))


def test_package_may_offer_the_function_of_its_module(folder: Path) -> None:
    (folder / "offering").mkdir()
    (folder / "offering" / "inner.py").write_text(FITNESS)
    (folder / "offering" / "__init__.py").write_text("from .inner import fitness")
    allow(["offering"])
    assert fitness_function(Fitness(function="offering:fitness"))(None, None) == 1.0


def test_file_is_loaded_without_its_folder(tmp_path: Path) -> None:
    (tmp_path / "filed_plugin.py").write_text(FITNESS)
    (tmp_path / "filed_other.py").write_text(FITNESS)
    allow([str(tmp_path / "filed_plugin.py")])
    assert allowed() == (str(tmp_path / "filed_plugin.py"),)
    function = load_function("filed_plugin:fitness", "key", 2)
    assert function(None, None) == 1.0
    with pytest.raises(UnknownPlugin, match="'filed_other' is not allowed"):
        load_function("filed_other:fitness", "key", 2)
    assert str(tmp_path) not in sys.path


def test_digest_does_not_depend_on_how_a_module_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "digested.py").write_text(FITNESS)
    named = b'{"function":"digested:fitness"}'
    allow([str(tmp_path / "digested.py")])
    by_file = plugins_of(named)
    check_plugins(by_file)
    permission._allowed.clear()
    forget_digests()
    assert plugins_of(named) == "digested="
    monkeypatch.syspath_prepend(tmp_path)
    forget_digests()
    assert plugins_of(named) == by_file


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        *((name, "must be a module outside") for name in (
            "os", "builtins", "subprocess.x", "schema.parts", "a b", "", "a..b", "..",
        )),
        ("nowhere_at_all", "no module 'nowhere_at_all' is installed"),
        ("nowhere/at_all.py", "no such file"),
    ],
)  # fmt: skip
def test_entry_that_is_no_plug_in_is_refused(entry: str, message: str) -> None:
    with pytest.raises(ExperimentError, match=f"--plugins: {message}"):
        allow([entry])


@pytest.mark.parametrize("ending", [".robot", ".zip", ""])
def test_a_copy_that_is_no_source_is_refused(tmp_path: Path, ending: str) -> None:
    file = tmp_path / f"copied{ending}"
    file.write_bytes(b"PK")
    with pytest.raises(
        UnknownPlugin, match=r"^--plugins: copied_lab=.* no such \.py f"
    ):
        allow([f"copied_lab={file}"])
    assert allowed() == ()


def test_file_with_the_name_of_another_module_is_refused(tmp_path: Path) -> None:
    for name in ("pytest", "twice_there"):
        (tmp_path / f"{name}.py").write_text(FITNESS)
    with pytest.raises(ExperimentError, match="has the name of another module"):
        allow([str(tmp_path / "pytest.py")])
    allow([str(tmp_path / "twice_there.py")])
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "twice_there.py").write_text(FITNESS)
    allow([str(tmp_path / "sub" / "twice_there.py")])
    (tmp_path / "twice_there.py").write_text(f"{FITNESS}\n")
    with pytest.raises(ExperimentError, match="has the name of another module"):
        allow([str(tmp_path / "twice_there.py")])


def test_own_experiment_allows_what_it_names_and_finds_it_beside(
    tmp_path: Path,
) -> None:
    (tmp_path / "beside_it.py").write_text(FITNESS)
    document = 'name = "x"\n[fitness]\nfunction = "beside_it:fitness"\n'
    (tmp_path / "x.toml").write_text(document)
    experiment = read_experiment(str(tmp_path / "x.toml"))
    assert allowed() == (str(tmp_path / "beside_it.py"),)
    assert fitness_function(experiment.fitness)(None, None) == 1.0


@pytest.mark.parametrize("path", ["os:system", "builtins:print", "schema.errors:x"])
def test_own_experiment_does_not_allow_the_standard_library(path: str) -> None:
    parse_experiment(f'name = "x"\n[fitness]\nfunction = "{path}"\n', "x.toml")
    assert allowed() == ()
    with pytest.raises(UnknownPlugin, match="is not allowed"):
        load_function(path, "fitness.function", 2)


def test_entry_points_are_allowed(folder: Path) -> None:
    (folder / "pointed_at.py").write_text(FITNESS)
    meta = folder / "pointed_at-1.dist-info"
    meta.mkdir()
    (meta / "METADATA").write_text("Metadata-Version: 2.1\nName: pointed-at\n")
    (meta / "entry_points.txt").write_text("[revolve.plugins]\nmine = pointed_at\n")
    permission._installed_modules.cache_clear()
    try:
        function = load_function("pointed_at:fitness", "key", 2)
        assert function(None, None) == 1.0
    finally:
        permission._installed_modules.cache_clear()


def test_a_short_name_is_built_in() -> None:
    assert load_object("best", "selection.survivors", {"best": 1, "random": 2}) == 1
    with pytest.raises(UnknownPlugin) as caught:
        load_object("bset", "selection.survivors", {"best": 1, "random": 2})
    assert str(caught.value) == (
        "selection.survivors: must be one of best, random or 'module:attribute', got "
        "'bset'; did you mean 'best'?"
    )


def test_an_own_object_must_have_the_members() -> None:
    built_in: dict[str, object] = {}
    path = "schema.parts:CORE"
    assert load_object(path, "x", built_in, ("arity",)) is BUILT_IN["Core"]
    with pytest.raises(ExperimentError, match=r"x: parts\.py:\d+: .* has no 'fly'"):
        load_object(path, "x", built_in, ("arity", "fly"))
