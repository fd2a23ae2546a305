"""Copies of plug-ins in run folders: only the user's own ones are imported."""

import re
import sys
from pathlib import Path

import pytest

from schema.errors import ExperimentError
from schema.plugins import permission
from schema.plugins.kept import KeptPlugin, allow_kept, kept_file, plugins_to_keep
from schema.plugins.permission import allow, allowed, import_allowed

DOCUMENT = '{"function":"kept_lab:judge"}'


@pytest.fixture(autouse=True)
def _own_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(permission, "_allowed", {})
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.fixture
def original(tmp_path: Path) -> Path:
    """Return a plug-in file of the user."""
    file = tmp_path / "kept_lab.py"
    file.write_text("judge = 1\n")
    return file


@pytest.fixture
def kept(tmp_path: Path, original: Path) -> dict[str, KeptPlugin]:
    """Return what a run keeps of the file; nothing is allowed any more."""
    allow([str(original)])
    (name, (note, source)) = next(iter(plugins_to_keep(DOCUMENT).items()))
    copy = kept_file(tmp_path / "run", name)
    copy.parent.mkdir(parents=True)
    copy.write_bytes(source)
    permission._allowed.clear()
    return {name: note}


def test_a_copy_of_the_user_is_allowed(
    tmp_path: Path, kept: dict[str, KeptPlugin]
) -> None:
    assert kept["kept_lab"].digest == "5ff4453f1603"
    allow_kept(tmp_path / "run", kept, is_resumed=True)
    assert allowed() == (str(tmp_path / "run" / "plugins" / "kept_lab.py"),)


def test_a_changed_original_stops_a_resumed_run_only(
    tmp_path: Path,
    original: Path,
    kept: dict[str, KeptPlugin],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    original.write_text("judge = 2\n")
    expected = r"kept_lab\.py has changed since .*: --plugins .*run/plugins/kept_lab"
    with pytest.raises(ExperimentError, match=expected):
        allow_kept(tmp_path / "run", kept, is_resumed=True)
    copy = kept_file(tmp_path / "run", "kept_lab")
    allow([str(copy)])
    allow_kept(tmp_path / "run", kept, is_resumed=True)
    permission._allowed.clear()
    for is_on_path in (False, True):
        if is_on_path:
            monkeypatch.syspath_prepend(tmp_path)  # as that of a Python script
        allow_kept(tmp_path / "run", kept, is_resumed=False)
        assert allowed() == (str(copy),)
        permission._allowed.clear()
    with pytest.raises(ExperimentError, match="was made with 5ff4453f1603; to use"):
        allow_kept(tmp_path / "run", kept, is_resumed=True)


@pytest.mark.parametrize("place", ["current folder", "script", "import path"])
def test_the_way_to_use_the_copy_is_named_and_works(
    tmp_path: Path,
    original: Path,
    kept: dict[str, KeptPlugin],
    monkeypatch: pytest.MonkeyPatch,
    place: str,
) -> None:
    original.write_text("judge = 2\n")
    other = tmp_path / "other"
    other.mkdir()
    if place == "current folder":  # python -m revolve
        monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    if place != "script":
        monkeypatch.syspath_prepend(other)
    copy = kept_file(tmp_path / "run", "kept_lab")
    way = f"--plugins {copy}"
    if place == "import path":
        way = f"remove {original} from the import path, and add {way}"
    with pytest.raises(ExperimentError, match=f"to use that one: {re.escape(way)}"):
        allow_kept(tmp_path / "run", kept, is_resumed=True)
    if place == "import path":
        with pytest.raises(ExperimentError, match="has the name of another module"):
            allow([str(copy)])
        monkeypatch.syspath_prepend(other)
        sys.path.remove(str(tmp_path))
    allow([str(copy)])
    allow_kept(tmp_path / "run", kept, is_resumed=True)
    assert allowed() == (str(copy),)
    assert import_allowed("kept_lab").judge == 1
    del sys.modules["kept_lab"]


def test_a_copy_does_not_replace_a_module_that_is_imported_or_named(
    tmp_path: Path,
    original: Path,
    kept: dict[str, KeptPlugin],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    original.write_text("judge = 2\n")
    monkeypatch.syspath_prepend(tmp_path)
    copy = str(kept_file(tmp_path / "run", next(iter(kept))))
    allow(["kept_lab"])
    with pytest.raises(ExperimentError, match="has the name of another module"):
        allow([copy])
    assert import_allowed("kept_lab").judge == 2
    permission._allowed.clear()
    with pytest.raises(ExperimentError, match="has the name of another module"):
        allow([copy])
    del sys.modules["kept_lab"]


def test_another_file_of_the_user_is_refused(
    tmp_path: Path, original: Path, kept: dict[str, KeptPlugin]
) -> None:
    original.write_text("judge = 2\n")
    allow([str(original)])
    with pytest.raises(ExperimentError, match="was made with 5ff4453f1603; to use"):
        allow_kept(tmp_path / "run", kept, is_resumed=False)


@pytest.mark.parametrize("is_resumed", [True, False])
def test_a_changed_copy_is_refused(
    tmp_path: Path,
    kept: dict[str, KeptPlugin],
    is_resumed: bool,  # noqa: FBT001 - a parameter of the test
) -> None:
    kept_file(tmp_path / "run", "kept_lab").write_text("judge = 3\n")
    with pytest.raises(ExperimentError, match=r"is damaged \(source digest .*FILE"):
        allow_kept(tmp_path / "run", kept, is_resumed=is_resumed)


def test_a_copy_of_somebody_else_is_refused(
    tmp_path: Path, kept: dict[str, KeptPlugin], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "other"))
    with pytest.raises(ExperimentError, match="was not written by a run of yours"):
        allow_kept(tmp_path / "run", kept, is_resumed=False)
    assert allowed() == ()


def test_a_seal_of_a_user_without_a_key_is_never_valid(
    tmp_path: Path, original: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    allow([str(original)])
    note, source = plugins_to_keep(DOCUMENT)["kept_lab"]
    assert note.seal == ""
    permission._allowed.clear()
    copy = kept_file(tmp_path / "run", "kept_lab")
    copy.parent.mkdir(parents=True)
    copy.write_bytes(source)
    with pytest.raises(ExperimentError, match="was not written by a run of yours"):
        allow_kept(tmp_path / "run", {"kept_lab": note}, is_resumed=False)


def test_a_key_that_others_can_read_is_not_used(
    tmp_path: Path, kept: dict[str, KeptPlugin]
) -> None:
    (tmp_path / "state" / "revolve" / "plugin-key").chmod(0o644)
    with pytest.raises(ExperimentError, match="was not written by a run of yours"):
        allow_kept(tmp_path / "run", kept, is_resumed=False)


def test_of_an_installed_module_the_digest_is_kept(
    tmp_path: Path, original: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    kept = {name: note for name, (note, _) in plugins_to_keep(DOCUMENT).items()}
    assert kept == {"kept_lab": KeptPlugin("5ff4453f1603")}
    allow_kept(tmp_path / "run", kept, is_resumed=True)
    original.write_text("judge = 2\n")
    with pytest.raises(ExperimentError, match="install that version, or start anoth"):
        allow_kept(tmp_path / "run", kept, is_resumed=True)
    allow_kept(tmp_path / "run", kept, is_resumed=False)


def test_built_ins_and_names_that_are_no_modules_are_not_kept() -> None:
    assert plugins_to_keep('["worker.fitness:thesis","no_such_module_at_all:x"]') == {}
