"""Compares shipped archipelagos on one coordinator with 2 and 5 groups of islands.

``python -m tests.system.equal_groups FOLDER [ARCHIPELAGO ...]`` keeps the runs in a
folder, and exits with 1 if a repeatable column differs.
"""

import subprocess
import sys
from pathlib import Path

from coordinator.storage.compare import compare

BIRTHS = {"archipelago-ring": 45, "archipelago-arenas": 25, "archipelago-mixed": 36}
NUMBERS = (2, 5)


def run(name: str, folder: Path, coordinators: int) -> Path:
    """Run an archipelago with seed 7; return its folder."""
    words = ("run", name, "--seed", "7", "--births", str(BIRTHS[name]), "--quiet")
    where = ("--coordinators", str(coordinators), "--out", str(folder))
    program = (sys.executable, "-m", "revolve", *words, "--workers", "2", *where)
    subprocess.run(program, check=True, stdout=subprocess.DEVNULL)
    return folder


def main(folder: Path, names: list[str]) -> int:
    """Run and compare; return the exit code."""
    code = 0
    for name in names or BIRTHS:
        whole = run(name, folder / f"{name}-1", 1)
        for number in NUMBERS:
            most = min(number, 4) if name == "archipelago-arenas" else number
            place = run(name, folder / f"{name}-{most}", most)
            found = compare(whole, place)
            outcome = ", ".join(found) or "equal"
            sys.stderr.write(f"{name}, {most} groups: {outcome}\n")
            code |= bool(found)
    return code


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), sys.argv[2:]))
