"""Runs that are killed: their commands, and the undisturbed runs they must equal."""

from tests.system import warm  # first: it prepares the process before NumPy's import
from tests.system.fleet import size

# isort: split
import json
import os
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from schema.tables.description import DETAILS, STATE
from schema.tables.segments import segments_of
from tests.system.instants import JOURNAL, Instants

FLAGS = ["--in-process", "--threads", "1", "--quiet"]


@dataclass
class Reference:
    """The undisturbed run of a document.

    Attributes:
        document: file.
        folder: of the run.
        cpu_s: CPU time of the run [s].
        running: number of the instants of each kind up to the end of the journal.
        ending: number of those behind it.
    """

    document: str
    folder: Path
    cpu_s: float = 0.0
    running: Counter[str] = field(default_factory=Counter)
    ending: Counter[str] = field(default_factory=Counter)

    @property
    def size(self) -> int:
        """Size of the journal [bytes]."""
        return size(self.folder)

    @property
    def has_poses(self) -> bool:
        return any(kind.startswith("write poses") for kind in self.running)


@dataclass
class Tally:
    """Results of the program."""

    kills: Counter[str] = field(default_factory=Counter)
    per_run: list[int] = field(default_factory=list)
    differences: list[str] = field(default_factory=list)


def log_of(folder: Path) -> Path:
    return folder.with_suffix(".log")


def words_of(document: str, folder: Path) -> list[str]:
    """Return the command that starts or resumes a run."""
    if (folder / DETAILS).exists():
        return ["resume", str(folder)]
    return ["run", document, "--seed", "4", "--out", str(folder)]


def undisturbed(document: str) -> Reference:
    """Make the first run of a document, and count its instants."""
    made = Reference(document, Path(Path(document).stem))
    instants, listing = Instants("", 0, 0.0, []), Path(f"{made.folder}.json")
    words = [*words_of(document, made.folder), *FLAGS]
    spent_s = os.times().children_user + os.times().children_system
    child = warm.start(
        words, log_of(made.folder), instants.install, lambda: instants.save(listing)
    )
    code = warm.wait(child, log_of(made.folder))
    assert code == 0, warm.tail(log_of(made.folder))
    made.cpu_s = os.times().children_user + os.times().children_system - spent_s
    kinds = json.loads(listing.read_text("utf-8"))
    last = len(kinds) - kinds[::-1].index(JOURNAL)
    made.running, made.ending = Counter(kinds[:last]), Counter(kinds[last:])
    return made


def check(reference: Reference, folder: Path, tally: Tally, kills: int) -> None:
    """Compare a finished run with the first run of its document."""
    assert (folder / STATE).read_text("utf-8") == "finished"
    tally.per_run.append(kills)
    words = ["compare", str(reference.folder), str(folder)]
    child = warm.start(words, log_of(folder))
    if warm.wait(child, log_of(folder)):
        tally.differences.append(f"{folder}:\n{warm.tail(log_of(folder))}")


def cut_poses(folder: Path, share: float) -> bool:
    """Cut the newest segment of poses to a share of its length, if there is one."""
    for _, path in segments_of(folder, "poses")[-1:]:
        if path.exists() and path.stat().st_size:
            os.truncate(path, int(share * path.stat().st_size))
            return True
    return False
