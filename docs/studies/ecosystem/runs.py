"""Makes the runs of the study of the ecosystem, for docs/ecosystem.md.

    python -m docs.studies.ecosystem.runs FOLDER                 # start, or go on
    python -m docs.studies.ecosystem.runs FOLDER --part control  # only a part
    python -m docs.studies.ecosystem.runs --missing              # count those that lack

Rows are kept in docs/data/ecosystem, in files of one row per run, per run and minute,
and per robot of the parts ``control`` and ``neutral``. Runs that have rows are skipped,
and a run that was begun in the folder is resumed. A run of few robots takes minutes of
one core; one that stays at the limit of 60, which stand in piles, up to two hours.
Those that are expected to be short come first; two are made side by side.
"""

import argparse
import shutil
import signal
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Lock
from typing import Any

from msgspec import Struct

import revolve as rv
from docs.studies.ecosystem.rows import course_rows, robot_rows, run_row
from docs.studies.pages import DOCS, append_csv, csv_rows
from schema.tables.description import DETAILS

DATA = DOCS / "data" / "ecosystem"
RUNS, COURSES, ROBOTS = (DATA / f"{name}.csv" for name in ("runs", "courses", "robots"))
GAINS = (2.0, 4.0, 8.0, 16.0)
"""Energy of a mating, without patches. With 32 all counts were those with 16."""
INTAKES = (0.025, 0.05, 0.1, 0.2)
"""Energy per second in a zone that is never empty; living costs 0.1 per second."""
INFLOWS = (0.125, 0.25, 0.5, 1.0)
COSTS = (0.025, 0.05, 0.1, 0.2)
UNBOUNDED = 1000.0
"""Inflow and capacity of a patch that 60 robots cannot empty."""
NEUTRAL = "docs.studies.ecosystem.neutral:NeutralRules"
WALKING_BIRTHS = 200
END_S = 1800.0
"""Simulated time of a run [s]."""
AT_ONCE = 2
_writing = Lock()


class Planned(Struct, frozen=True):
    """A run: its part, the swept settings, its seed.

    Attributes:
        part: of the study.
        first, second: values of the part's settings; 0 where it has less.
        seed: of the run.
    """

    part: str
    first: float
    second: float
    seed: int

    @property
    def names(self) -> dict[str, str]:
        """Return the first columns of its rows."""
        return {
            "part": self.part,
            "first": f"{self.first:g}",
            "second": f"{self.second:g}",
            "seed": str(self.seed),
        }

    @property
    def plenty(self) -> float:
        """Return a number that grows with the robots that can live, and so the time."""
        if self.part == "chemostat":
            return self.first / self.second
        return {"gain": 10.0, "zones": 1000.0}.get(self.part, 0.0) * self.first

    @property
    def parameters(self) -> dict[str, Any]:
        """Return the settings of the rules that differ from the shipped ones."""
        if self.part == "gain":
            return {"patches": 0, "mating_gain": self.first}
        if self.part == "zones":
            zone = {"patch_inflow": UNBOUNDED, "patch_capacity": UNBOUNDED}
            return zone | {"intake_per_s": self.first}
        if self.part == "chemostat":
            return {"patch_inflow": self.first, "energy_per_s": self.second}
        return {}


SEEDS = {
    "control": 10,
    "gain": 3,
    "zones": 3,
    "chemostat": 5,
    "walkers": 5,
}
"""Seeds of each part; a run of ``control`` makes its neutral twin as well.

Three where energy has no bound: a run that stays at the limit takes up to two hours.
"""


def planned() -> Iterator[Planned]:
    """Yield all runs, seed by seed, so that each part grows at the same rate."""
    for seed in range(1, max(SEEDS.values()) + 1):
        for part, count in SEEDS.items():
            if seed > count:
                continue
            if part in ("gain", "zones"):
                values = GAINS if part == "gain" else INTAKES
                yield from (Planned(part, value, 0.0, seed) for value in values)
            elif part == "chemostat":
                for inflow in INFLOWS:
                    for cost in COSTS:
                        yield Planned(part, inflow, cost, seed)
            else:
                yield Planned(part, 0.0, 0.0, seed)


def missing(part: str | None) -> list[Planned]:
    """Return the runs that have no row; those that are expected to be short first."""
    kept = [tuple(row.values())[:4] for row in csv_rows(RUNS)]
    runs = [
        own
        for own in planned()
        if part in (None, own.part) and tuple(own.names.values()) not in kept
    ]
    return sorted(runs, key=lambda own: own.plenty)


def make(own: Planned, place: Path) -> None:
    """Make a run, and a control's neutral twin; keep the rows."""
    folder = place / "-".join(own.names.values())
    swept = {"parameters": own.parameters, "end_s": END_S}
    experiment = rv.Experiment.read("ecosystem", arena=swept)
    if own.part == "walkers":
        experiment = experiment.replace(founders=_walkers(own.seed, folder))
    run = finished(experiment, own.seed, folder / "run")
    if own.part == "control":
        # The twin first: the run's own row says that both are there.
        keep(own.names | {"part": "neutral"}, _neutral(experiment, run, own, folder))
    keep(own.names, run)
    shutil.rmtree(folder)
    print(" ".join(own.names.values()), flush=True)


def _walkers(seed: int, folder: Path) -> dict[str, Any]:
    """Return founders that walk: the last population of a run off-line."""
    walking = folder / "walking"
    finished(rv.Experiment.read("scenario1", births=WALKING_BIRTHS), seed, walking)
    return {"run": str(walking), "population": "last"}


def _neutral(
    experiment: rv.Experiment, twin: rv.Run, own: Planned, folder: Path
) -> rv.Run:
    born = twin.births.to_pandas()
    children = born["sim_time_s"][born["parents"].map(len) > 0].tolist()
    times = {"births_s": children, "deaths_s": twin.deaths["sim_time_s"].to_pylist()}
    arena = {"rules": NEUTRAL, "parameters": own.parameters | times}
    neutral = experiment.replace(arena=arena)
    return finished(neutral, own.seed, folder / "neutral")


def finished(experiment: rv.Experiment, seed: int, out: Path) -> rv.Run:
    """Return a run at its end; one that was begun is resumed."""
    if (out / DETAILS).is_file():
        return rv.resume(out, workers=1)
    return rv.run(experiment, seed=seed, workers=1, out=out)


def keep(names: dict[str, str], run: rv.Run) -> None:
    """Append the rows of a run; its own row last, which says that all are there."""
    courses, own = course_rows(run), run_row(run)
    robots = robot_rows(run) if names["part"] in ("control", "neutral") else []
    with _writing:
        for row in courses:
            append_csv(COURSES, names | row)
        for row in robots:
            append_csv(ROBOTS, names | row)
        append_csv(RUNS, names | own)


def main() -> None:
    """Make the runs that are missing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", help="of the runs")
    parser.add_argument("--part", choices=SEEDS)
    parser.add_argument("--missing", action="store_true")
    options = parser.parse_args()
    runs = missing(options.part)
    if options.missing:
        print(f"{len(runs)} of {len([*planned()])} runs are missing")
        return
    if options.folder is None:
        parser.error("FOLDER: needed to make runs")
    # Ctrl-C ends this process without a wait for its threads. The processes of the runs
    # end with it; the next time they are resumed.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    with ThreadPoolExecutor(AT_ONCE) as pool:
        for _ in pool.map(lambda own: make(own, options.folder), runs):
            pass


if __name__ == "__main__":
    main()
