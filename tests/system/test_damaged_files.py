"""Small files of run folders with any content: what each command does."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from analysis.measures.load import read_run, read_runs
from analysis.viewer.replay import read_news
from coordinator.storage.compare import compare
from coordinator.storage.journal import Position, read_records
from coordinator.storage.lock import read_holder
from revolve import command as revolve
from schema.errors import RunFolderError
from schema.tables import segments
from schema.tables.description import description_text, read_description, read_state
from tests.system.workspace import said

pytestmark = pytest.mark.system

DOCUMENT = """
name = "tiny"
births = 10
[selection]
population = 6
[simulation]
warmup_steps = 5
window_steps = 40
"""
QUIET = ("--in-process", "--quiet")
FILES = ("run.json", "state", "epoch", "lock", "address")


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a finished run and the same run, stopped half-way."""
    root = tmp_path_factory.mktemp("runs")
    (root / "tiny.toml").write_text(DOCUMENT)
    words = ("run", str(root / "tiny.toml"), "--seed", "3", *QUIET)
    for name in ("whole", "half"):
        assert revolve.main([*words, "--out", str(root / name)]) == 0
    _unfinish(root / "half")
    return root


def _unfinish(folder: Path) -> None:
    """Turn a finished run into one that was stopped half-way."""
    plain = replace(read_description(folder), digests={})
    (folder / "run.json").write_text(description_text(plain))
    shutil.rmtree(folder / "tables")
    (folder / "best.yaml").unlink()
    (folder / "state").write_text("stopped")
    data = (folder / "journal.bin").read_bytes()
    position = Position()
    ends = [position.end for _ in read_records(data, position)]
    (folder / "journal.bin").write_bytes(data[: ends[len(ends) // 2]])


def contents(name: str, sound: bytes) -> Iterator[bytes]:
    """Yield wrong contents of a file: fixed ones, random bytes and changed bits."""
    yield from (
        b"",
        sound[:-1],
        sound[: len(sound) // 2],
        sound + b"\0",
        b"\0" * 50,
        b"\xff\xfe\xfd",
        b"\x1b[2J\x1b]0;title\x07",
        b"9" * 5000,
        b"-1",
        b"1e400",
        b"[" * 100_000,
        b'{"name":' * 10_000,
        b'{"name": "a\x1b[31m", "run": 0, "seed": 0, "document": "{}"}',
        b'{"name": "a", "run": -1, "seed": 1e9, "document": 3}',
        b'{"name": "\\ud800", "run": 0, "seed": 0, "document": "\\ud800"}',
        b"null",
        b"finished",
        b"finished" if name == "state" else b"16777215",
    )
    rng = np.random.default_rng([15, *name.encode()])
    for _ in range(3):
        yield rng.bytes(int(rng.integers(1, 200)))
    for bit in rng.choice(len(sound) * 8, size=8, replace=False).tolist():
        at, mask = bit // 8, 1 << bit % 8
        yield sound[:at] + bytes([sound[at] ^ mask]) + sound[at + 1 :]


class Command:
    """Runs commands in this process and returns what they say about files."""

    def __init__(
        self, output: pytest.CaptureFixture[str], log: pytest.LogCaptureFixture
    ) -> None:
        self._output, self._log = output, log

    def __call__(self, *words: str) -> tuple[int, list[str]]:
        """Return exit code and lines; a line may not control the terminal."""
        segments.warn_once.cache_clear()
        self._log.clear()
        self._output.readouterr()
        code = revolve.main(list(words))
        told = said(self._output.readouterr().err)
        # Lines for the user are both on standard error and in the log.
        told += [each.getMessage() for each in self._log.records]
        assert all(line.isprintable() for line in told), told
        lines = dict.fromkeys(told)
        return code, [line for line in lines if "already finished" not in line]


@pytest.fixture
def command(
    capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> Command:
    return Command(capsys, caplog)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("which", ["whole", "half"])
def test_a_damaged_file_gives_one_line_and_never_another_run(
    folders: Path, tmp_path: Path, command: Command, which: str, name: str
) -> None:
    """Status, log, compare, the readers of analyze and view; then resume."""
    whole = folders / "whole"
    sound = (folders / which / name).read_bytes() if name != "address" else b"hub\n"
    readers: list[Callable[[Path], object]] = [
        lambda run: read_runs([run]), lambda run: read_news(read_run(run)),
    ]  # fmt: skip
    for number, content in enumerate(contents(name, sound)):
        run = tmp_path / str(number)
        shutil.copytree(folders / which, run)
        (run / name).write_bytes(content)
        case = f"{name} as {content[:60]!r}"
        for words in (["status"], ["log", "--json"], ["compare", str(whole)]):
            code, lines = command(*words, str(run))
            assert code in (0, 1, 2), case
            assert len(lines) <= 1, (case, lines)
        shown = command("status", str(run))
        for read in readers:
            with suppress(RunFolderError):
                read(run)
        code, lines = command("resume", str(run), *QUIET)
        assert len(lines) <= 2, (case, lines)
        if code == 0:
            # Finished is true: all rows are there.
            assert read_state(run) == "finished", case
            assert not compare(whole, run), case
        else:
            assert name == "run.json", (case, lines)
            assert "damaged" in lines[0], (case, lines)
            assert shown[0] == 1, case
        assert read_holder(run) == ""
        shutil.rmtree(run)
