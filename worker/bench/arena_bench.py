"""``revolve bench arena`` and ``revolve bench spider``: the thesis's benchmarks.

Source: Hupkes 2016, figures 6.1 and 7.1; the code of the original.
"""

import argparse
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from msgspec.structs import replace

from schema.errors import ExperimentError, RevolveError
from schema.experiment.document import Experiment, Vetting, body_space
from schema.experiment.file import read_experiment
from schema.experiment.settings import ArenaSettings
from schema.flags import add_count, whole_number
from schema.parts import BodySpace
from schema.robot.genome import Genome, develop
from schema.robot.ids import BirthId
from schema.robot.results import Report
from schema.robot.robot import Robot
from worker.bench import arena_timing as timing
from worker.bench.spider import CLEARANCE_M, grid, spider

THESIS = (-0.26, 34.78, 20.41)
"""Real-time factor in the thesis: a + b / p + c / p^2 on an i7-4790K."""
SIZES = tuple(range(5, 51, 5))

RESULTS = pa.schema(
    [
        pa.field("benchmark", pa.string()),
        pa.field("population", pa.int32()),
        pa.field("repetition", pa.int32()),
        pa.field("threads", pa.int32()),
        pa.field("step_s", pa.float64()),
        pa.field("simulated_s", pa.float64()),
        pa.field("wall_s", pa.float64()),
        pa.field("factor", pa.float64()),
    ],
    metadata={"revolve.schema": "arena-benchmark", "revolve.schema_version": "1"},
)
"""One row per repetition; ``factor`` is simulated over wall time."""

Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class RobotSource:
    """Random robots, from the generator and the analyzer of the other rooms.

    Attributes:
        generate: returns a random genome of an experiment.
        analyze: vets a robot.
    """

    generate: Callable[[np.random.Generator, Experiment, BirthId], Genome]
    analyze: Callable[[Robot, BodySpace, Vetting], Report]

    def random(self, experiment: Experiment, count: int, seed: int) -> list[Robot]:
        """Return random robots that are not vetted."""
        rng, space = np.random.default_rng(seed), body_space(experiment.space)
        return [
            develop(self.generate(rng, experiment, BirthId(0, number)), space)
            for number in range(count)
        ]

    def vetted(self, experiment: Experiment, count: int, seed: int) -> list[Robot]:
        """Return random robots that can be built, as founders are."""
        rng, space = np.random.default_rng(seed), body_space(experiment.space)
        robots: list[Robot] = []
        while len(robots) < count:
            genome = self.generate(rng, experiment, BirthId(0, len(robots)))
            robot = develop(genome, space)
            if self.analyze(robot, space, experiment.vetting).is_viable:
                robots.append(robot)
        return robots


def add_commands(kinds: Any) -> None:  # noqa: ANN401 - argparse hides its type
    """Add the two benchmarks to the sub-commands of ``revolve bench``."""
    for name, text, seconds, repetitions in (
        ("arena", "random robots in one arena, thesis figure 6.1", 10, 20),
        ("spider", "spiders on a grid, thesis figure 7.1", 5, 20),
    ):
        parser = kinds.add_parser(name, help=text)
        add_experiment(parser, "scenario3")
        parser.add_argument(
            "--sizes",
            type=whole_number(),
            nargs="+",
            default=SIZES,
            metavar="N",
            help="numbers of robots (default: 5 10 ... 50)",
        )
        add_count(parser, "--seconds", seconds, "simulated seconds per repetition")
        add_count(
            parser, "--repetitions", repetitions, "repetitions per number of robots"
        )
        add_count(parser, "--threads", 1, "threads that simulate the arena")
        add_count(parser, "--seed", 1, "seed of the robots and their places", least=0)
        parser.add_argument("--out", type=Path, help="Parquet file for the results")


def add_experiment(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the argument for the experiment of a benchmark."""
    parser.add_argument(
        "experiment",
        nargs="?",
        default=default,
        help="experiment whose settings to use, a .toml file or a shipped one "
        "(default: %(default)s)",
    )


def run(options: argparse.Namespace, robots: RobotSource) -> int:
    """Run one of the two benchmarks and print the results.

    Args:
        options: as ``add_commands`` parses them.
        robots: source of random robots.

    Returns:
        0.

    Raises:
        ExperimentError: an invalid or off-line experiment.
        RevolveError: the file for the results cannot be written.
    """
    experiment = read_experiment(options.experiment)
    rows: list[Row] = []
    with _kept(options.out) as keep:
        for size in options.sizes:
            timings = (
                _spiders(experiment, size, options)
                if options.what == "spider"
                else _random(experiment, size, options, robots)
            )
            new = [_row(options, number, each) for number, each in enumerate(timings)]
            keep(new)
            rows += new
            factors = [row["factor"] for row in new]
            _say(_line(size, factors, options.what))
    if options.what == "arena" and len(options.sizes) >= len(THESIS):
        found = timing.quadratic_fit(
            [row["population"] for row in rows], [row["factor"] for row in rows]
        )
        _say(f"fit:    {_formula(found)}", f"thesis: {_formula(THESIS)}")
    if options.out is not None:
        _say(f"{len(rows)} rows in {options.out}")
    return 0


@contextmanager
def _kept(path: Path | None) -> Iterator[Callable[[Sequence[Row]], None]]:
    """Yield a function that appends rows to the file, if there is one.

    Raises:
        RevolveError: the file cannot be written; raised before the first measurement.
    """
    if path is None:
        yield lambda _rows: None
        return
    try:
        file = path.open("wb")
    except OSError as error:
        raise RevolveError(f"{path}: cannot be written: {error.strerror}") from None
    with file, pq.ParquetWriter(file, RESULTS) as writer:
        yield lambda rows: writer.write(pa.Table.from_pylist(rows, schema=RESULTS))


def arena_settings_of(experiment: Experiment) -> ArenaSettings:
    """Return the settings of an experiment's arena.

    Raises:
        ExperimentError: it is off-line.
    """
    if experiment.arena is None:
        raise ExperimentError(f"{experiment.name}: has no [arena]")
    return ArenaSettings(
        space=experiment.space,
        simulation=experiment.simulation,
        fitness=experiment.fitness,
        arena=experiment.arena,
        environment=experiment.environment,
    )


def _random(
    experiment: Experiment, size: int, options: argparse.Namespace, source: RobotSource
) -> Iterable[timing.ArenaTiming]:
    settings = arena_settings_of(experiment)
    for number in range(options.repetitions):
        seed = options.seed + 1000 * size + number
        robots = source.vetted(experiment, size, seed)
        rng = np.random.default_rng(seed)
        places = timing.birth_places(rng, size, settings)
        yield timing.time_arena(
            settings,
            timing.insertions(robots, places),
            seconds=options.seconds,
            threads=options.threads,
        )


def _spiders(
    experiment: Experiment, size: int, options: argparse.Namespace
) -> Iterable[timing.ArenaTiming]:
    settings = arena_settings_of(experiment)
    settings = replace(settings, arena=replace(settings.arena, drop_m=CLEARANCE_M))
    for _ in range(options.repetitions):
        yield timing.time_arena(
            settings,
            timing.insertions([spider()] * size, grid(size)),
            seconds=options.seconds,
            threads=options.threads,
        )


def _row(options: argparse.Namespace, number: int, found: timing.ArenaTiming) -> Row:
    experiment = read_experiment(options.experiment)
    return {
        "benchmark": options.what,
        "population": found.robots,
        "repetition": number,
        "threads": options.threads,
        "step_s": experiment.simulation.timestep_s,
        "simulated_s": found.simulated_s,
        "wall_s": found.wall_s,
        "factor": found.factor,
    }


def _line(size: int, factors: Sequence[float], what: str) -> str:
    values = np.asarray(factors)
    line = (
        f"{size:4d} robots: {values.mean():6.2f} x real time "
        f"(sd {values.std():.2f}, {values.min():.2f}..{values.max():.2f})"
    )
    if what == "arena":
        a, b, c = THESIS
        line += f"; thesis {a + b / size + c / size**2:.2f}"
    return line


def _formula(numbers: Iterable[float]) -> str:
    a, b, c = numbers
    return f"factor = {a:.2f} {b:+.2f} / p {c:+.2f} / p^2"


def _say(*lines: str) -> None:
    sys.stdout.write("\n".join(lines) + "\n")
    sys.stdout.flush()
