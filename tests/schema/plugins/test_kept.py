"""Copies of plug-ins in run folders: only the user's own ones are imported."""

import os
import py_compile
import sys
from collections.abc import Iterator
from importlib import invalidate_caches
from pathlib import Path

import pytest

from schema.errors import ExperimentError, PluginDiffers
from schema.limits import MOST_PLUGIN_BYTES
from schema.plugins import permission
from schema.plugins.kept import KeptPlugin, allow_kept, keep, kept_file
from schema.plugins.load import load_object
from schema.plugins.permission import (
    allow,
    allow_references,
    allowed,
    import_allowed,
)
from schema.plugins.source import check_plugins, digest_of, forget_digests

Kept = dict[str, KeptPlugin]
DOCUMENT = '{"function":"kept_lab:judge"}'


@pytest.fixture(autouse=True)
def _own_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(permission, "_allowed", {})
    forget_digests()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.fixture
def original(tmp_path: Path) -> Path:
    """Return a plug-in file of the user."""
    file = tmp_path / "kept_lab.py"
    file.write_text("judge = 1\n")
    return file


def write(file: Path, data: bytes) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(data)


def kept_by(run: Path, document: str = DOCUMENT) -> Kept:
    """Return what a run keeps; nothing is allowed or in use any more."""
    kept = keep(run, document, write)
    forget()
    return kept


def forget() -> None:
    permission._allowed.clear()
    permission._copies.clear()


@pytest.fixture
def kept(tmp_path: Path, original: Path) -> Kept:
    """Return what a run keeps of the file; nothing is allowed any more."""
    allow([str(original)])
    return kept_by(tmp_path / "run")


def test_a_copy_of_the_user_is_allowed(tmp_path: Path, kept: Kept) -> None:
    assert kept["kept_lab"].digest == "5ff4453f1603"
    allow_kept(tmp_path / "run", kept, is_resumed=True)
    assert allowed() == (f"kept_lab={tmp_path}/run/plugins/kept_lab.py",)


@pytest.mark.parametrize("is_resumed", [True, False])
@pytest.mark.parametrize("place", ["", "first", "last"])
def test_a_changed_original_does_not_matter(
    tmp_path: Path,
    *,
    kept: Kept,
    monkeypatch: pytest.MonkeyPatch,
    place: str,
    is_resumed: bool,
) -> None:
    """Wherever Python would find it: that of a script, or an installed module."""
    (tmp_path / "kept_lab.py").write_text("judge = 2\n")
    if place:
        at = 0 if place == "first" else len(sys.path)
        monkeypatch.setattr(sys, "path", list(sys.path))
        sys.path.insert(at, str(tmp_path))
    allow_kept(tmp_path / "run", kept, is_resumed=is_resumed)
    entries = allowed()
    forget()
    # As in a worker that this process starts.
    allow(entries)
    assert allowed() == entries
    check_plugins("kept_lab=5ff4453f1603")
    assert import_allowed("kept_lab").judge == 1
    del sys.modules["kept_lab"]


def test_the_run_uses_its_copy_from_its_start(tmp_path: Path, original: Path) -> None:
    allow([str(original)])
    keep(tmp_path / "run", DOCUMENT, write)
    original.write_text("judge = 2\n")
    assert allowed() == (f"kept_lab={tmp_path}/run/plugins/kept_lab.py",)
    assert digest_of("kept_lab") == "5ff4453f1603"
    # A later run of the same campaign has the same source.
    assert keep(tmp_path / "two", DOCUMENT, write)["kept_lab"].digest == "5ff4453f1603"


def test_another_file_that_is_named_is_refused(
    tmp_path: Path, original: Path, kept: Kept
) -> None:
    original.write_text("judge = 2\n")
    allow([str(original)])
    copy = kept_file(tmp_path / "run", "kept_lab")
    way = f"made with 5ff4453f1603: to use that one: --plugins kept_lab={copy}"
    for is_resumed in (True, False):
        with pytest.raises(ExperimentError, match=way):
            allow_kept(tmp_path / "run", kept, is_resumed=is_resumed)
    forget()
    allow([f"kept_lab={copy}"])
    allow_kept(tmp_path / "run", kept, is_resumed=True)
    assert import_allowed("kept_lab").judge == 1
    del sys.modules["kept_lab"]


def test_a_module_that_was_imported_before_an_edit_is_not_that_of_a_later_run(
    tmp_path: Path, original: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its text on disk is that of the second run; in memory is that of the first."""
    monkeypatch.syspath_prepend(tmp_path)
    original.write_text("judge = 2\n")
    two = kept_by(tmp_path / "two")
    original.write_text("judge = 1\n")
    one = kept_by(tmp_path / "one")
    allow(["kept_lab"])
    assert load_object("kept_lab:judge", "here", {}) == 1
    original.write_text("judge = 2\n")
    with pytest.raises(ExperimentError, match=r"digest 5ff4453f1603, but .*three was"):
        keep(tmp_path / "three", DOCUMENT, write)
    forget()
    allow_kept(tmp_path / "one", one, is_resumed=False)
    with pytest.raises(ExperimentError, match=r"digest 5ff4453f1603, but .*two was"):
        allow_kept(tmp_path / "two", two, is_resumed=False)
    del sys.modules["kept_lab"]


def test_copies_of_two_runs_do_not_mix(
    tmp_path: Path, original: Path, kept: Kept
) -> None:
    original.write_text("judge = 2\n")
    allow([str(original)])
    other = kept_by(tmp_path / "other")
    allow_kept(tmp_path / "run", kept, is_resumed=False)
    with pytest.raises(ExperimentError, match="in Python: in a new process"):
        allow_kept(tmp_path / "other", other, is_resumed=False)
    with pytest.raises(ExperimentError, match=r"run/plugins/kept_lab\.py is in use"):
        allow([f"kept_lab={kept_file(tmp_path / 'other', 'kept_lab')}"])


def test_a_copy_is_imported_as_it_is(tmp_path: Path, kept: Kept) -> None:
    """Not from a compiled file beside it."""
    copy = kept_file(tmp_path / "run", "kept_lab")
    write_time = copy.stat().st_mtime_ns
    copy.write_text("judge = 7\n")
    os.utime(copy, ns=(write_time, write_time))
    py_compile.compile(str(copy))
    copy.write_text("judge = 1\n")
    os.utime(copy, ns=(write_time, write_time))
    allow_kept(tmp_path / "run", kept, is_resumed=False)
    assert import_allowed("kept_lab").judge == 1
    del sys.modules["kept_lab"]


PACKAGE = {
    "__init__.py": "from . import parts\n",
    "parts.py": "from kept_pack.deep.rules import RULE\nPART = RULE + 1\n",
    "deep/__init__.py": "",
    "deep/rules.py": "RULE = 1\n",
    "deep/late.py": "import kept_pack.deep.rules as rules\nLATE = rules.RULE + 2\n",
    "table.csv": "1,2\n",
}


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return the folder of a package on the import path; it is not imported later."""
    folder = tmp_path / "site" / "kept_pack"
    for name, text in PACKAGE.items():
        write(folder / name, text.encode())
    monkeypatch.syspath_prepend(folder.parent)
    before = set(sys.modules)
    yield folder
    for name in set(sys.modules) - before:
        del sys.modules[name]


NAMED = '{"function":"kept_pack.deep.late:LATE"}'


def test_all_modules_of_a_package_come_from_the_copy(
    tmp_path: Path, package: Path
) -> None:
    run = tmp_path / "run"
    kept = kept_by(run, NAMED)
    before = digest_of("kept_pack")
    found = {path.relative_to(run) for path in run.rglob("*") if path.is_file()}
    assert {str(path) for path in found} == {
        f"plugins/kept_pack/{name}" for name in PACKAGE
    }
    for name in ("parts.py", "deep/rules.py", "deep/late.py"):
        (package / name).write_text("raise ValueError\n")
    (package / "table.csv").write_text("3\n")
    # As in `resume`, which then reads the document, and in a worker that it starts.
    allow_kept(run, kept, is_resumed=True)
    allow_references(["kept_pack.deep.late:LATE"])
    entries = allowed()
    forget()
    allow(entries)
    check_plugins(f"kept_pack={before}")
    module = import_allowed("kept_pack.deep.late")
    assert (module.LATE, sys.modules["kept_pack"].parts.PART) == (3, 2)
    assert Path(str(module.__file__)).is_relative_to(run)
    assert not list(run.rglob("*.pyc"))
    # Not more than before: only what the document names.
    assert not permission.is_allowed("kept_pack.parts")


@pytest.mark.parametrize("name", ["deep/extra.py", "table.csv", "deep/rules.pyd"])
def test_a_file_that_a_package_did_not_have_is_refused(
    tmp_path: Path, package: Path, name: str
) -> None:
    assert package.is_dir()
    kept = kept_by(tmp_path / "run", NAMED)
    package.rename(package.with_name("elsewhere"))
    (tmp_path / "run" / "plugins" / "kept_pack" / name).write_text("1")
    with pytest.raises(ExperimentError, match=r"is damaged|was not written by"):
        allow_kept(tmp_path / "run", kept, is_resumed=True)
    assert not permission._copies


@pytest.mark.parametrize("name", ["fast.cpython-311-x86_64-linux-gnu.so", "table.csv"])
def test_of_a_compiled_or_large_package_the_digest_is_kept(
    tmp_path: Path, package: Path, name: str
) -> None:
    (package / name).write_bytes(bytes(MOST_PLUGIN_BYTES))
    kept = kept_by(tmp_path / "run", NAMED)
    assert kept == {"kept_pack": KeptPlugin(digest_of("kept_pack"))}
    assert not (tmp_path / "run").exists()
    allow_kept(tmp_path / "run", kept, is_resumed=True)
    (package / "parts.py").write_text("")
    allow_kept(tmp_path / "run", kept, is_resumed=False)
    with pytest.raises(ExperimentError, match="install that version, or start anoth"):
        allow_kept(tmp_path / "run", kept, is_resumed=True)


def test_a_folder_without_init_is_a_package_too(tmp_path: Path, package: Path) -> None:
    (package / "__init__.py").unlink()
    kept = kept_by(tmp_path / "run", NAMED)
    (package / "deep" / "rules.py").write_text("RULE = 5\n")
    allow_kept(tmp_path / "run", kept, is_resumed=True)
    allow_references(["kept_pack.deep.late:LATE"])
    assert import_allowed("kept_pack.deep.late").LATE == 3


def test_data_files_that_a_module_names_are_kept(
    tmp_path: Path, original: Path
) -> None:
    text = "from pathlib import Path\n"
    text += "judge = Path(__file__).with_name('goals.csv').read_text()\n"
    original.write_text(text)
    for name in ("goals.csv", "other.csv", "goals.py"):
        (tmp_path / name).write_text(name)
    allow([str(original)])
    kept = kept_by(tmp_path / "run")
    names = {path.name for path in (tmp_path / "run" / "plugins").iterdir()}
    assert names == {"kept_lab.py", "goals.csv"}
    (tmp_path / "goals.csv").write_text("changed")
    allow_kept(tmp_path / "run", kept, is_resumed=True)
    assert import_allowed("kept_lab").judge == "goals.csv"
    del sys.modules["kept_lab"]
    forget()
    (tmp_path / "run" / "plugins" / "goals.csv").write_text("changed")
    with pytest.raises(ExperimentError, match="was not written by a run of yours"):
        allow_kept(tmp_path / "run", kept, is_resumed=True)


def test_data_files_of_one_name_that_differ_are_refused(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write(tmp_path / name / f"kept_{name}.py", b"# goals.csv")
        write(tmp_path / name / "goals.csv", name.encode())
        allow([str(tmp_path / name / f"kept_{name}.py")])
    with pytest.raises(ExperimentError, match=r"goals\.csv differs from that"):
        keep(tmp_path / "run", '["kept_a:x","kept_b:x"]', write)


@pytest.mark.parametrize("is_resumed", [True, False])
def test_a_changed_copy_is_refused(
    tmp_path: Path,
    kept: Kept,
    is_resumed: bool,  # noqa: FBT001 - a parameter of the test
) -> None:
    kept_file(tmp_path / "run", "kept_lab").write_text("judge = 3\n")
    (tmp_path / "kept_lab.py").unlink()
    with pytest.raises(ExperimentError, match=r"is damaged \(source digest .*FILE"):
        allow_kept(tmp_path / "run", kept, is_resumed=is_resumed)


def test_a_copy_of_somebody_else_is_refused(
    tmp_path: Path, kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "other"))
    copy = kept_file(tmp_path / "run", "kept_lab")
    way = f"was not written by a run of yours .*; add --plugins kept_lab={copy}"
    with pytest.raises(ExperimentError, match=way.replace("; ", ".*")):
        allow_kept(tmp_path / "run", kept, is_resumed=False)
    assert allowed() == ()
    allow([f"kept_lab={copy}"])
    allow_kept(tmp_path / "run", kept, is_resumed=True)
    forget()
    # The same source, found on the import path, needs no flag.
    monkeypatch.syspath_prepend(tmp_path)
    allow_kept(tmp_path / "run", kept, is_resumed=True)
    assert not permission._copies


def test_without_a_state_folder_a_copy_needs_the_flag(
    tmp_path: Path, original: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    allow([str(original)])
    kept = kept_by(tmp_path / "run")
    with pytest.raises(ExperimentError, match="was not written by a run of yours"):
        allow_kept(tmp_path / "run", kept, is_resumed=False)


def test_a_copy_of_an_earlier_version_needs_the_flag(
    tmp_path: Path, original: Path
) -> None:
    """It has a seal, which is not used."""
    write(tmp_path / "run" / "plugins" / "kept_lab.py", original.read_bytes())
    kept = {"kept_lab": KeptPlugin("5ff4453f1603", str(original), "a" * 64)}
    with pytest.raises(ExperimentError, match="was not written by a run of yours"):
        allow_kept(tmp_path / "run", kept, is_resumed=False)
    allow([f"kept_lab={kept_file(tmp_path / 'run', 'kept_lab')}"])
    allow_kept(tmp_path / "run", kept, is_resumed=False)
    assert import_allowed("kept_lab").judge == 1
    del sys.modules["kept_lab"]


def test_built_ins_and_names_that_are_no_modules_are_not_kept(tmp_path: Path) -> None:
    named = '["worker.fitness:thesis","no_such_module_at_all:x"]'
    assert keep(tmp_path, named, write) == {}


def test_a_separate_worker_says_how_it_gets_the_source(
    tmp_path: Path, original: Path
) -> None:
    allow([str(original)])
    run = f"host:12ab:{tmp_path}/runs/a"
    way = f"give {original} the content that it had when the run began, or start this "
    way += f"process with the run's copy: --plugins kept_lab={tmp_path}/runs/a/plugins/"
    with pytest.raises(PluginDiffers, match=f"{way}kept_lab\\.py$"):
        check_plugins("kept_lab=123456789abc", run)
    with pytest.raises(PluginDiffers, match=r"content that it had when the run began$"):
        check_plugins("kept_lab=123456789abc", "python-host-1234")


def test_a_new_run_has_the_present_source(
    tmp_path: Path,
    original: Path,
    kept: Kept,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In Python, a run may be started after an earlier one was read."""
    original.write_text("judge = 2\n")
    monkeypatch.syspath_prepend(tmp_path)
    allow_kept(tmp_path / "run", kept, is_resumed=False)
    copy = kept_file(tmp_path / "run", "kept_lab")
    assert allowed() == (f"kept_lab={copy}",)
    assert allowed(is_new=True) == ("kept_lab",)
    original.unlink()
    invalidate_caches()
    assert allowed(is_new=True) == (f"kept_lab={copy}",)
