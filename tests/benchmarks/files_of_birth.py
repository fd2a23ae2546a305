"""Source files that one off-line birth enters, in one process.

``python -m tests.benchmarks.files_of_birth`` counts them from the births row of one
robot to that of the next, the first of a brood: variation and vetting of the brood, the
evaluation of the robot, journal and tables.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from unittest.mock import patch

from coordinator.cli import main_loop
from coordinator.islands.events import Record
from coordinator.storage.recorder import Recorder
from revolve.command import main

ROOT = Path(__file__).parents[2]
ROOMS = ("schema", "coordinator", "worker", "analyzer", "analysis", "revolve")
FIRST = 30
"""Births before the one that counts: founders and a brood."""


def files_of_birth() -> list[str]:
    """Return the files by their paths in the repository, in order."""
    files: set[Path] = set()
    write, born = Recorder.write, 0

    def enter(frame: FrameType, event: str, _argument: object) -> None:
        if event == "call":
            files.add(Path(frame.f_code.co_filename))

    def written(recorder: Recorder, record: Record) -> None:
        nonlocal born
        write(recorder, record)
        born += record.table == "births"
        if record.table == "births" and born in (FIRST, FIRST + 1):
            sys.setprofile(enter if born == FIRST else None)

    with (
        TemporaryDirectory() as folder,
        patch.object(Recorder, "write", written),
        # What happens by the clock, such as the display, does not belong to a birth.
        patch.multiple(main_loop, _TURN_S=60.0, _CHORES_S=60.0),
    ):
        words = f"revolve run scenario1 --births {2 * FIRST} --seed 7 --in-process"
        with patch("sys.argv", [*words.split(), "--quiet", "--out", f"{folder}/run"]):
            main()
    inside = {file.relative_to(ROOT) for file in files if file.is_relative_to(ROOT)}
    return sorted(str(file) for file in inside if file.parts[0] in ROOMS)


if __name__ == "__main__":
    entered = files_of_birth()
    print(*entered, len(entered), sep="\n")
