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
from schema.plugins.permission import allow, allow_references, allowed, import_allowed
from schema.plugins.source import check_plugins, digest_of, forget_digests

Kept = dict[str, KeptPlugin]
DOCUMENT = '{"function":"kept_lab:judge"}'


@pytest.fixture(autouse=True)
def _own_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(permission, "_allowed", {})
    forget_digests()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def write(file: Path, data: bytes) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(data)


def forget() -> None:
    permission._allowed.clear()
    permission._copies.clear()


def imported() -> object:
    """Return what the module has now; it is imported again each time."""
    judge: object = import_allowed("kept_lab").judge
    del sys.modules["kept_lab"]
    return judge


class Lab:
    """A folder with a plug-in file of the user, and a run."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.run = folder, folder / "run"
        self.original = folder / "kept_lab.py"
        self.edit("judge = 1\n")
        self.copy = kept_file(self.run, "kept_lab")

    def edit(self, text: str) -> None:
        self.original.write_text(text)

    def kept(self, run: str = "run", document: str = DOCUMENT) -> Kept:
        """Return what a run keeps; nothing is allowed or in use any more."""
        kept = keep(self.folder / run, document, write)
        forget()
        return kept

    def refuse(self, kept: Kept, why: str, *flags: bool) -> None:
        """Check that the plug-ins of the run are refused, resumed or not."""
        for is_resumed in flags:
            with pytest.raises(ExperimentError, match=why):
                allow_kept(self.run, kept, is_resumed=is_resumed)


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    return Lab(tmp_path)


@pytest.fixture
def kept(lab: Lab) -> Kept:
    """Return what a run keeps of the file; nothing is allowed any more."""
    allow([str(lab.original)])
    return lab.kept()


def test_a_copy_of_the_user_is_allowed(lab: Lab, kept: Kept) -> None:
    assert kept["kept_lab"].digest == "5ff4453f1603"
    allow_kept(lab.run, kept, is_resumed=True)
    assert allowed() == (f"kept_lab={lab.folder}/run/plugins/kept_lab.py",)


@pytest.mark.parametrize("is_resumed", [True, False])
@pytest.mark.parametrize("place", ["", "first", "last"])
def test_a_changed_original_does_not_matter(
    lab: Lab,
    *,
    kept: Kept,
    monkeypatch: pytest.MonkeyPatch,
    place: str,
    is_resumed: bool,
) -> None:
    """Wherever Python would find it: that of a script, or an installed module."""
    lab.edit("judge = 2\n")
    if place:
        at = 0 if place == "first" else len(sys.path)
        monkeypatch.setattr(sys, "path", list(sys.path))
        sys.path.insert(at, str(lab.folder))
    allow_kept(lab.run, kept, is_resumed=is_resumed)
    entries = allowed()
    forget()
    # As in a worker that this process starts.
    allow(entries)
    assert allowed() == entries
    check_plugins("kept_lab=5ff4453f1603")
    assert imported() == 1


def test_the_run_uses_its_copy_from_its_start(lab: Lab) -> None:
    allow([str(lab.original)])
    keep(lab.run, DOCUMENT, write)
    lab.edit("judge = 2\n")
    assert allowed() == (f"kept_lab={lab.folder}/run/plugins/kept_lab.py",)
    assert digest_of("kept_lab") == "5ff4453f1603"
    # A later run of the same campaign has the same source.
    again = keep(lab.folder / "two", DOCUMENT, write)["kept_lab"]
    assert again.digest == "5ff4453f1603"


def test_another_file_that_is_named_is_refused(lab: Lab, kept: Kept) -> None:
    lab.edit("judge = 2\n")
    allow([str(lab.original)])
    way = f"made with 5ff4453f1603: to use that one: --plugins kept_lab={lab.copy}"
    lab.refuse(kept, way, True, False)
    forget()
    allow([f"kept_lab={lab.copy}"])
    allow_kept(lab.run, kept, is_resumed=True)
    assert imported() == 1


def test_a_module_that_was_imported_before_an_edit_is_not_that_of_a_later_run(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its text on disk is that of the second run; in memory is that of the first."""
    monkeypatch.syspath_prepend(lab.folder)
    lab.edit("judge = 2\n")
    two = lab.kept("two")
    lab.edit("judge = 1\n")
    one = lab.kept("one")
    allow(["kept_lab"])
    assert load_object("kept_lab:judge", "here", {}) == 1
    lab.edit("judge = 2\n")
    with pytest.raises(ExperimentError, match=r"digest 5ff4453f1603, but .*three was"):
        keep(lab.folder / "three", DOCUMENT, write)
    forget()
    allow_kept(lab.folder / "one", one, is_resumed=False)
    with pytest.raises(ExperimentError, match=r"digest 5ff4453f1603, but .*two was"):
        allow_kept(lab.folder / "two", two, is_resumed=False)
    del sys.modules["kept_lab"]


def test_copies_of_two_runs_do_not_mix(lab: Lab, kept: Kept) -> None:
    lab.edit("judge = 2\n")
    allow([str(lab.original)])
    other = lab.kept("other")
    allow_kept(lab.run, kept, is_resumed=False)
    with pytest.raises(ExperimentError, match="in Python: in a new process"):
        allow_kept(lab.folder / "other", other, is_resumed=False)
    with pytest.raises(ExperimentError, match=r"run/plugins/kept_lab\.py is in use"):
        allow([f"kept_lab={kept_file(lab.folder / 'other', 'kept_lab')}"])


def test_a_copy_is_imported_as_it_is(lab: Lab, kept: Kept) -> None:
    """Not from a compiled file beside it."""
    write_time = lab.copy.stat().st_mtime_ns
    lab.copy.write_text("judge = 7\n")
    os.utime(lab.copy, ns=(write_time, write_time))
    py_compile.compile(str(lab.copy))
    lab.copy.write_text("judge = 1\n")
    os.utime(lab.copy, ns=(write_time, write_time))
    allow_kept(lab.run, kept, is_resumed=False)
    assert imported() == 1


PACKAGE = {
    "__init__.py": "from . import parts\n",
    "parts.py": "from kept_pack.deep.rules import RULE\nPART = RULE + 1\n",
    "deep/__init__.py": "",
    "deep/rules.py": "RULE = 1\n",
    "deep/late.py": "import kept_pack.deep.rules as rules\nLATE = rules.RULE + 2\n",
    "table.csv": "1,2\n",
}


@pytest.fixture
def package(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return the folder of a package on the import path; it is not imported later."""
    folder = lab.folder / "site" / "kept_pack"
    for name, text in PACKAGE.items():
        write(folder / name, text.encode())
    monkeypatch.syspath_prepend(folder.parent)
    before = set(sys.modules)
    yield folder
    for name in set(sys.modules) - before:
        del sys.modules[name]


NAMED = '{"function":"kept_pack.deep.late:LATE"}'


def test_all_modules_of_a_package_come_from_the_copy(lab: Lab, package: Path) -> None:
    run = lab.run
    kept = lab.kept(document=NAMED)
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
    lab: Lab, package: Path, name: str
) -> None:
    assert package.is_dir()
    kept = lab.kept(document=NAMED)
    package.rename(package.with_name("elsewhere"))
    (lab.run / "plugins" / "kept_pack" / name).write_text("1")
    lab.refuse(kept, r"is damaged|was not written by", True)
    assert not permission._copies


@pytest.mark.parametrize("name", ["fast.cpython-311-x86_64-linux-gnu.so", "table.csv"])
def test_of_a_compiled_or_large_package_the_digest_is_kept(
    lab: Lab, package: Path, name: str
) -> None:
    (package / name).write_bytes(bytes(MOST_PLUGIN_BYTES))
    kept = lab.kept(document=NAMED)
    assert kept == {"kept_pack": KeptPlugin(digest_of("kept_pack"))}
    assert not (lab.run).exists()
    allow_kept(lab.run, kept, is_resumed=True)
    (package / "parts.py").write_text("")
    allow_kept(lab.run, kept, is_resumed=False)
    lab.refuse(kept, "install that version, or start anoth", True)


def test_a_folder_without_init_is_a_package_too(lab: Lab, package: Path) -> None:
    (package / "__init__.py").unlink()
    kept = lab.kept(document=NAMED)
    (package / "deep" / "rules.py").write_text("RULE = 5\n")
    allow_kept(lab.run, kept, is_resumed=True)
    allow_references(["kept_pack.deep.late:LATE"])
    assert import_allowed("kept_pack.deep.late").LATE == 3


def test_data_files_that_a_module_names_are_kept(lab: Lab) -> None:
    text = "from pathlib import Path\n"
    text += "judge = Path(__file__).with_name('goals.csv').read_text()\n"
    lab.edit(text)
    for name in ("goals.csv", "other.csv", "goals.py"):
        (lab.folder / name).write_text(name)
    allow([str(lab.original)])
    kept = lab.kept()
    names = {path.name for path in (lab.run / "plugins").iterdir()}
    assert names == {"kept_lab.py", "goals.csv"}
    (lab.folder / "goals.csv").write_text("changed")
    allow_kept(lab.run, kept, is_resumed=True)
    assert imported() == "goals.csv"
    forget()
    (lab.run / "plugins" / "goals.csv").write_text("changed")
    lab.refuse(kept, "was not written by a run of yours", True)


def test_data_files_of_one_name_that_differ_are_refused(lab: Lab) -> None:
    for name in ("a", "b"):
        write(lab.folder / name / f"kept_{name}.py", b"# goals.csv")
        write(lab.folder / name / "goals.csv", name.encode())
        allow([str(lab.folder / name / f"kept_{name}.py")])
    with pytest.raises(ExperimentError, match=r"goals\.csv differs from that"):
        keep(lab.run, '["kept_a:x","kept_b:x"]', write)


@pytest.mark.parametrize("is_resumed", [True, False])
def test_a_changed_copy_is_refused(
    lab: Lab,
    kept: Kept,
    is_resumed: bool,  # noqa: FBT001 - a parameter of the test
) -> None:
    lab.copy.write_text("judge = 3\n")
    lab.original.unlink()
    lab.refuse(kept, r"is damaged \(source digest .*FILE", is_resumed)


def test_a_copy_of_somebody_else_is_refused(
    lab: Lab, kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(lab.folder / "other"))
    way = f"was not written by a run of yours .*; add --plugins kept_lab={lab.copy}"
    lab.refuse(kept, way.replace("; ", ".*"), False)
    assert allowed() == ()
    allow([f"kept_lab={lab.copy}"])
    allow_kept(lab.run, kept, is_resumed=True)
    forget()
    # The same source, found on the import path, needs no flag.
    monkeypatch.syspath_prepend(lab.folder)
    allow_kept(lab.run, kept, is_resumed=True)
    assert not permission._copies


def test_without_a_state_folder_a_copy_needs_the_flag(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    (lab.folder / "file").write_text("")
    monkeypatch.setenv("XDG_STATE_HOME", str(lab.folder / "file"))
    allow([str(lab.original)])
    kept = lab.kept()
    lab.refuse(kept, "was not written by a run of yours", False)


def test_a_copy_of_an_earlier_version_needs_the_flag(lab: Lab) -> None:
    """It has a seal, which is not used."""
    write(lab.run / "plugins" / "kept_lab.py", lab.original.read_bytes())
    kept = {"kept_lab": KeptPlugin("5ff4453f1603", str(lab.original), "a" * 64)}
    lab.refuse(kept, "was not written by a run of yours", False)
    allow([f"kept_lab={kept_file(lab.folder / 'run', 'kept_lab')}"])
    allow_kept(lab.run, kept, is_resumed=False)
    assert imported() == 1


def test_built_ins_and_names_that_are_no_modules_are_not_kept(lab: Lab) -> None:
    named = '["worker.fitness:thesis","no_such_module_at_all:x"]'
    assert keep(lab.folder, named, write) == {}


def test_a_separate_worker_says_how_it_gets_the_source(lab: Lab) -> None:
    allow([str(lab.original)])
    run = f"host:12ab:{lab.folder}/runs/a"
    way = f"give {lab.original} the content that it had when the run began, or .* with "
    way += f"the run's copy: --plugins kept_lab={lab.folder}/runs/a/plugins/"
    with pytest.raises(PluginDiffers, match=f"{way}kept_lab\\.py$"):
        check_plugins("kept_lab=123456789abc", run)
    with pytest.raises(PluginDiffers, match=r"content that it had when the run began$"):
        check_plugins("kept_lab=123456789abc", "python-host-1234")


def test_a_new_run_has_the_present_source(
    lab: Lab, kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In Python, a run may be started after an earlier one was read."""
    lab.edit("judge = 2\n")
    monkeypatch.syspath_prepend(lab.folder)
    allow_kept(lab.run, kept, is_resumed=False)
    assert allowed() == (f"kept_lab={lab.copy}",)
    assert allowed(is_new=True) == ("kept_lab",)
    lab.original.unlink()
    invalidate_caches()
    assert allowed(is_new=True) == (f"kept_lab={lab.copy}",)
