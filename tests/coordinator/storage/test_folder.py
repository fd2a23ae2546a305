"""Run folders: lock, description, epoch, state."""

import errno
import fcntl
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from msgspec.structs import replace

from coordinator.storage.folder import RunFolder, read_details
from coordinator.storage.hints import keep_flags
from coordinator.storage.journal import Journal
from coordinator.storage.lock import read_holder
from schema.agent.version import VERSION
from schema.errors import RunFolderError
from schema.experiment.file import experiment_text, read_experiment
from schema.robot.ids import BirthId
from schema.tables.description import (
    RunDetails,
    description_text,
    read_description,
    read_state,
)
from schema.wire.messages import Bred

DETAILS = RunDetails("scenario1", 3, 2**64 - 1, '{"name": "scenario1", "ü": 1}')
MINOR = VERSION.rpartition(".")[0]
HOLD = """
import sys
from pathlib import Path
from coordinator.storage.folder import RunFolder
with RunFolder(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""
LOOKED_AT_S = 0.05


@contextmanager
def opened(path: Path) -> Iterator[tuple[RunFolder, Journal]]:
    """Open a run as its next coordinator does."""
    with RunFolder(path) as folder, Journal.open(path, epoch=folder.epoch) as journal:
        yield folder, journal


@contextmanager
def held(path: Path, before: str = "") -> Iterator[str]:
    """Hold a run in another process, which is killed; yield how it is named."""
    with subprocess.Popen(
        [sys.executable, "-c", before + HOLD, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == b"held\n"
        yield f"process {child.pid} on {socket.gethostname()}"
        # Not even SIGKILL leaves the folder locked.
        child.send_signal(signal.SIGKILL)
        child.wait()
    assert read_holder(path) == ""


def test_a_new_run_in_a_removed_folder_has_another_name(tmp_path: Path) -> None:
    """Workers that outlive a run must not confuse it with the new run."""
    path = tmp_path / "run"
    with RunFolder(path, DETAILS) as first:
        assert first.name.endswith(f":{path}")
    with RunFolder(path) as resumed:
        assert resumed.name == first.name
    shutil.rmtree(path)
    with RunFolder(path, DETAILS) as anew:
        assert anew.epoch == 1
        assert anew.name != first.name


def test_a_description_without_nonce_is_read(tmp_path: Path) -> None:
    RunFolder(tmp_path, DETAILS).close()
    entries = json.loads((tmp_path / "run.json").read_text())
    del entries["nonce"], entries["digest"]
    (tmp_path / "run.json").write_text(json.dumps(entries))
    with RunFolder(tmp_path) as folder:
        assert folder.details == DETAILS


@pytest.mark.parametrize(
    ("begun_by", "named"),
    [(VERSION, ""), (f"{MINOR}.99", ""), ("", "0.2"), ("0.2.5", "0.2"), ("1.0", "1.0")],
)
def test_a_run_is_resumed_by_the_minor_version_that_began_it(
    tmp_path: Path, begun_by: str, named: str
) -> None:
    RunFolder(tmp_path, DETAILS).close()
    known = read_description(tmp_path)
    assert known.version == VERSION
    text = description_text(replace(known, version=begun_by))
    (tmp_path / "run.json").write_text(text)
    if not named:
        RunFolder(tmp_path).close()
        return
    message = f"{named} began this run, and this is {MINOR}: .*=={named}\\.\\*$"
    with pytest.raises(RunFolderError, match=message):
        RunFolder(tmp_path)


@pytest.mark.parametrize("left", [None, "1"])
def test_a_lost_epoch_voids_nothing_that_is_written_later(
    tmp_path: Path, left: str | None
) -> None:
    """The file is missing, or an older one has replaced it."""
    path = tmp_path / "run"
    RunFolder(path, DETAILS).close()
    events = [Bred(BirthId(0, number), 0, ("refused",)) for number in range(5)]
    for number, event in enumerate(events):
        if number == 2 and left is None:
            (path / "epoch").unlink()
        elif number == 2 and left is not None:
            (path / "epoch").write_text(left)
        with opened(path) as (folder, journal):
            folder.confirm()
            assert journal.replay() == events[:number]
            journal.append([event])
    with Journal.open(path) as journal:
        assert journal.replay() == events


def test_a_used_folder_is_refused_with_the_hint_of_other_settings(
    tmp_path: Path,
) -> None:
    first = read_experiment("scenario1")
    details = RunDetails("scenario1", 0, 1, experiment_text(first))
    # An older version had fewer keys.
    document = json.loads(details.document)
    del document["environment"]
    older = replace(details, document=json.dumps(document))
    RunFolder(tmp_path / "run", older).close()
    with pytest.raises(RunFolderError, match="already holds a run; to resume it"):
        RunFolder(tmp_path / "run", details)
    births = experiment_text(replace(first, births=9))
    for other, why in (
        (replace(details, document=births), "this run with 3000 births; to resume it"),
        (replace(details, seed=7), "holds a run with other settings"),
    ):
        with pytest.raises(RunFolderError, match=why):
            RunFolder(tmp_path / "run", other)
    keep_flags(tmp_path / "run", ["--workers", "0"])
    with pytest.raises(RunFolderError, match=r"resume \S+/run --workers 0; or choose"):
        RunFolder(tmp_path / "run", details)
    assert RunFolder(tmp_path / "run").epoch == 2


def test_only_a_new_run_that_has_not_started_is_forgotten(tmp_path: Path) -> None:
    """A run that was archived without epoch and journal keeps its description."""
    path = tmp_path / "run"
    with RunFolder(path, DETAILS) as folder:
        folder.forget()
    assert [entry.name for entry in path.iterdir()] == ["lock"]
    RunFolder(path, DETAILS).close()
    (path / "epoch").unlink()
    with RunFolder(path) as folder:
        folder.forget()
    assert read_details(path) == DETAILS
    other = tmp_path / "other"
    with RunFolder(other, DETAILS) as folder, Journal.open(other):
        folder.forget()
    assert read_details(other) == DETAILS


def test_a_folder_with_foreign_files_is_refused_and_unchanged(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(RunFolderError, match=r"not empty \(contains 'thesis.tex'\)"):
        RunFolder(tmp_path, DETAILS)
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


@pytest.mark.parametrize("leftover", ["lock", ".run.json.new"])
def test_a_folder_is_usable_after_a_kill_while_it_was_created(
    tmp_path: Path, leftover: str
) -> None:
    (tmp_path / leftover).write_text("{")
    with RunFolder(tmp_path, DETAILS) as folder:
        assert folder.epoch == 1


@pytest.mark.parametrize("details", [None, DETAILS])
def test_a_second_coordinator_is_refused_and_told_the_holder(
    tmp_path: Path, details: RunDetails | None
) -> None:
    path = tmp_path / "run"
    RunFolder(path, DETAILS).close()
    with held(path) as name:
        assert read_holder(path) == name
        with pytest.raises(RunFolderError, match=f"in use by {name}"):
            RunFolder(path, details)
    with RunFolder(path) as folder:
        # The refused one did not count.
        assert folder.epoch == 3


def test_reading_the_holder_does_not_refuse_a_coordinator(tmp_path: Path) -> None:
    path = tmp_path / "run"
    RunFolder(path, DETAILS).close()
    with (path / "lock").open() as lock:
        fcntl.flock(lock, fcntl.LOCK_SH)
        assert read_holder(path) == ""
        end = threading.Timer(LOOKED_AT_S, fcntl.flock, (lock, fcntl.LOCK_UN))
        end.start()
        with RunFolder(path) as folder:
            assert folder.epoch == 2
        end.join()


@pytest.mark.parametrize("may_read", [True, False])
def test_a_lock_of_another_user_is_not_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, may_read: bool
) -> None:
    real = os.open

    def open_as_other(path: Path, flags: int) -> int:
        if flags & os.O_ACCMODE != os.O_RDONLY or not may_read:
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return real(path, flags)

    with RunFolder(tmp_path, DETAILS):
        holder = read_holder(tmp_path)
        monkeypatch.setattr(os, "open", open_as_other)
        unknown = "another process, perhaps (lock: Permission denied)"
        assert read_holder(tmp_path) == (holder if may_read else unknown)


def test_a_child_process_does_not_keep_the_lock(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run", DETAILS)
    assert not os.get_inheritable(folder._lock._descriptor)
    with subprocess.Popen(
        [sys.executable, "-c", "import sys; sys.stdin.read()"],
        stdin=subprocess.PIPE,
        close_fds=False,
    ):
        folder.close()
        with RunFolder(tmp_path / "run") as again:
            assert again.epoch == 2


def test_a_replaced_coordinator_notices_it(tmp_path: Path) -> None:
    with RunFolder(tmp_path / "run", DETAILS) as old:
        old.confirm()
        # A lock that does not hold: its file was removed, or the disk knows none.
        (tmp_path / "run" / "lock").unlink()
        with RunFolder(tmp_path / "run") as new:
            new.confirm()
            with pytest.raises(RunFolderError, match="coordinator 2 has taken it over"):
                old.confirm()


def test_a_moved_folder_is_noticed(tmp_path: Path) -> None:
    with RunFolder(tmp_path / "run", DETAILS) as folder:
        folder.path.rename(tmp_path / "elsewhere")
        with pytest.raises(RunFolderError, match="was moved or removed"):
            folder.confirm()


def test_a_lower_epoch_in_the_folder_is_no_takeover(tmp_path: Path) -> None:
    RunFolder(tmp_path / "run", DETAILS).close()
    RunFolder(tmp_path / "run").close()
    with RunFolder(tmp_path / "run") as folder:
        assert folder.epoch == 3
        (tmp_path / "run" / "epoch").write_text("2")
        folder.confirm()


def test_an_epoch_that_the_journal_cannot_number_is_damaged(tmp_path: Path) -> None:
    RunFolder(tmp_path / "run", DETAILS).close()
    (tmp_path / "run" / "epoch").write_text(str(2**32))
    with RunFolder(tmp_path / "run") as folder:
        assert folder.epoch == 1000  # above the journal's, which has no record
    assert (tmp_path / "run" / "epoch").read_text() == "1000"


@pytest.mark.parametrize(
    "content",
    [b"many", b"", b"-3", b"\xff\x00", b"1" * 5000, b"99999999", b"%d" % (2**64 - 1)],
)
def test_a_damaged_epoch_is_replaced_by_one_after_that_of_the_journal(
    tmp_path: Path, content: bytes
) -> None:
    """No record that the next coordinator writes is void."""
    path = tmp_path / "run"
    events = [Bred(BirthId(0, number), 0, ("refused",)) for number in range(2)]
    RunFolder(path, DETAILS).close()
    for event in events:
        with opened(path) as (folder, journal):
            (path / "epoch").write_bytes(content)
            with pytest.raises(RunFolderError, match=r"damaged.*revolve resume"):
                folder.confirm()
            journal.append([event])
    with RunFolder(path) as folder:
        folder.confirm()
        assert int((path / "epoch").read_text()) == folder.epoch
    with Journal.open(path) as journal:
        assert journal.replay() == events


@pytest.mark.parametrize("bit", range(8))
def test_each_changed_bit_of_a_description_is_noticed(tmp_path: Path, bit: int) -> None:
    """JSON with the same values may differ in white space only."""
    with RunFolder(tmp_path, DETAILS) as folder:
        folder.seal({"births": "0" * 64})
    file = tmp_path / "run.json"
    sound = file.read_bytes()
    for at in range(len(sound)):
        file.write_bytes(sound[:at] + bytes([sound[at] ^ 1 << bit]) + sound[at + 1 :])
        try:
            found = read_description(tmp_path)
        except RunFolderError as error:
            assert "damaged" in str(error)  # noqa: PT017 - not all bits are damage
        else:
            assert sound[at : at + 1].isspace()
            assert found.seed == DETAILS.seed


def test_a_large_file_is_refused_before_it_is_read(tmp_path: Path) -> None:
    RunFolder(tmp_path, DETAILS).close()
    for name, read in (("run.json", read_details), ("state", read_state)):
        with (tmp_path / name).open("wb") as file:
            file.truncate(100 << 30)  # more than the memory
        with pytest.raises(RunFolderError, match=f"{name}: damaged: must have at most"):
            read(tmp_path)


def entries(**changes: object) -> str:
    """Return a description without digest."""
    return json.dumps({"name": "a", "run": 0, "seed": 0, "document": "{}", **changes})


@pytest.mark.parametrize(
    ("text", "story"),
    [
        ("{", "Input data was truncated"),
        ('{"name": "a"}', "must have a key 'run'"),
        (entries(run="0"), "must be a whole number.*run"),
        (entries(run=-1), "run"), (entries(run=2**31), "run"),
        (entries(seed=-1), "seed"), (entries(seed=2**64), "seed"),
        (entries(seed=10**400), "seed"), (entries(name=""), "name"),
        (entries(name="a\x1b[31m"), "name"), (entries(name="a" * 2000), "name"),
    ],
)  # fmt: skip
def test_a_damaged_description_is_refused(
    tmp_path: Path, text: str, story: str
) -> None:
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(RunFolderError, match=rf"damaged: .*{story}") as caught:
        read_details(tmp_path)
    assert str(caught.value).isprintable()


def test_the_holder_of_a_lock_is_shown_without_terminal_escapes(tmp_path: Path) -> None:
    with RunFolder(tmp_path, DETAILS):
        (tmp_path / "lock").write_bytes(b"\x1b[2J\nprocess\x00" + b"\xff" * 1000)
        holder = read_holder(tmp_path)
        assert holder.isprintable()
        assert len(holder) <= 200


def test_the_state_is_read_by_other_processes(tmp_path: Path) -> None:
    with RunFolder(tmp_path / "run", DETAILS) as folder:
        assert read_state(folder.path) == "running"
        folder.set_state("finished")
        assert read_state(folder.path) == "finished"
        (folder.path / "state").write_text("asleep")
        with pytest.raises(RunFolderError, match="must be one of running"):
            read_state(folder.path)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(RunFolderError, match="cannot be written"):
        RunFolder(tmp_path / "run", DETAILS)


NO_LOCKS = """
import errno, fcntl
def flock(*_):
    raise OSError(errno.ENOSYS, "Function not implemented")
fcntl.flock = flock
"""


@pytest.fixture
def _no_locks(monkeypatch: pytest.MonkeyPatch) -> None:
    def flock(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", flock)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
@pytest.mark.usefixtures("_no_locks")
def test_without_file_locks_a_second_coordinator_of_this_machine_is_refused(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "run"
    for details in (DETAILS, None):
        with RunFolder(path, details):
            assert (
                read_holder(path) == f"process {os.getpid()} on {socket.gethostname()}"
            )
        assert read_holder(path) == ""
    assert caplog.text.count(f"{path}: no file locks") == 1
    with held(path, NO_LOCKS) as name:
        (tmp_path / "link").symlink_to(path)
        for each in (path, tmp_path / "link"):
            assert read_holder(each) == name
            with pytest.raises(RunFolderError, match=f"in use by {name}"):
                RunFolder(each)
    RunFolder(path).close()


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
@pytest.mark.usefixtures("_no_locks")
def test_without_file_locks_a_coordinator_of_another_machine_is_replaced(
    tmp_path: Path,
) -> None:
    first = RunFolder(tmp_path, DETAILS)
    first._lock.close()
    (tmp_path / "lock").write_text("process 7 on far")
    # It may run still.
    assert read_holder(tmp_path) == "process 7 on far"
    with RunFolder(tmp_path), pytest.raises(RunFolderError, match="has taken it over"):
        first.confirm()
