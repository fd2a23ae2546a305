"""``revolve bench arena`` and ``revolve bench spider``: the thesis's benchmarks.

Source: Hupkes 2016, figures 6.1 and 7.1; the code of the original.
"""

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from msgspec import Struct
from msgspec.structs import replace

from schema.agent.flags import add_count, whole_number
from schema.errors import RevolveError
from schema.experiment.document import Experiment, Vetting, body_space
from schema.experiment.file import read_experiment
from schema.experiment.settings import arena_settings_of
from schema.parts import BodySpace
from schema.robot.genome import Genome, develop
from schema.robot.ids import BirthId
from schema.robot.results import Report
from schema.robot.robot import Robot
from worker.bench.arena_timing import (
    birth_places,
    insertions,
    quadratic_fit,
    time_arena,
)
from worker.bench.spider import CLEARANCE_M, grid, spider

THESIS = (-0.26, 34.78, 20.41)
"""Real-time factor in the thesis: a + b / p + c / p^2 on an i7-4790K."""
SIZES = tuple(range(5, 51, 5))

RESULTS = pa.schema(
    {
        "benchmark": pa.string(),
        **dict.fromkeys(("population", "repetition", "threads"), pa.int32()),
        **dict.fromkeys(("step_s", "simulated_s", "wall_s", "factor"), pa.float64()),
    },
    metadata={"revolve.schema": "arena-benchmark", "revolve.schema_version": "1"},
)
"""One row per repetition; ``factor`` is simulated over wall time."""

Row = dict[str, Any]


class RobotSource(Struct, frozen=True):
    """Random robots, from the generator and the analyzer of the other rooms."""

    generate: Callable[[np.random.Generator, Experiment, BirthId], Genome]
    analyze: Callable[[Robot, BodySpace, Vetting], Report]

    def robots(
        self, experiment: Experiment, count: int, seed: int, *, is_vetted: bool
    ) -> list[Robot]:
        """Return random robots; if vetted, only those that can be built."""
        rng, space = np.random.default_rng(seed), body_space(experiment.space)
        robots: list[Robot] = []
        while len(robots) < count:
            genome = self.generate(rng, experiment, BirthId(0, len(robots)))
            robot = develop(genome, space)
            if (
                not is_vetted
                or self.analyze(robot, space, experiment.vetting).is_viable
            ):
                robots.append(robot)
        return robots


def add_commands(kinds: Any) -> None:  # noqa: ANN401 - argparse hides its type
    """Add the two benchmarks to the sub-commands of ``revolve bench``."""
    for name, text, seconds in (
        ("arena", "random robots in one arena, thesis figure 6.1", 10),
        ("spider", "spiders on a grid, thesis figure 7.1", 5),
    ):
        parser = kinds.add_parser(
            name,
            help=text,
            description=f"Time {text}.",
            examples=(
                f"revolve bench {name} --sizes 5 10 --repetitions 3",
                f"revolve bench {name} scenario3 --out {name}.parquet",
            ),
        )
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
        add_count(parser, "--repetitions", 20, "repetitions per number of robots")
        add_count(
            parser, "--threads", 1, "number of threads that advance one arena together"
        )
        add_count(
            parser, "--seed", 1, "random seed, of the robots and their places", least=0
        )
        parser.add_argument(
            "--out", type=Path, metavar="FILE", help="file to write; Parquet"
        )


def add_experiment(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the argument for the experiment of a benchmark."""
    parser.add_argument(
        "experiment",
        nargs="?",
        default=default,
        metavar="NAME|FILE.toml",
        help="experiment whose settings to use (default: %(default)s)",
    )


def run(options: argparse.Namespace, robots: RobotSource) -> int:
    """Run one of the two benchmarks and print the results."""
    experiment = read_experiment(options.experiment)
    rows: list[Row] = []
    with (
        _opened(options.out or Path(os.devnull)) as file,
        pq.ParquetWriter(file, RESULTS) as writer,
    ):
        for size in options.sizes:
            new = list(_rows(experiment, size, options, robots))
            writer.write(pa.Table.from_pylist(new, schema=RESULTS))
            rows += new
            _say(_line(size, [row["factor"] for row in new], options.what))
    if options.what == "arena" and len(options.sizes) >= len(THESIS):
        found = quadratic_fit(
            [row["population"] for row in rows], [row["factor"] for row in rows]
        )
        _say(f"fit:    {_formula(found)}", f"thesis: {_formula(THESIS)}")
    if options.out is not None:
        _say(f"{len(rows)} rows in {options.out}")
    return 0


def _opened(path: Path) -> BinaryIO:
    """Return a new file, opened before the first measurement."""
    try:
        return path.open("wb")
    except OSError as error:
        raise RevolveError(f"{path}: cannot be written: {error.strerror}") from None


def _rows(
    experiment: Experiment, size: int, options: argparse.Namespace, source: RobotSource
) -> Iterator[Row]:
    settings = arena_settings_of(experiment)
    if options.what == "spider":
        settings = replace(settings, arena=replace(settings.arena, drop_m=CLEARANCE_M))
    for number in range(options.repetitions):
        if options.what == "spider":
            robots, places = [spider()] * size, grid(size)
        else:
            seed = options.seed + 1000 * size + number
            robots = source.robots(experiment, size, seed, is_vetted=True)
            places = birth_places(np.random.default_rng(seed), size, settings)
        simulated_s, wall_s = time_arena(
            settings,
            insertions(robots, places),
            seconds=options.seconds,
            threads=options.threads,
        )
        yield {
            "benchmark": options.what,
            "population": size,
            "repetition": number,
            "threads": options.threads,
            "step_s": settings.simulation.timestep_s,
            "simulated_s": simulated_s,
            "wall_s": wall_s,
            "factor": simulated_s / wall_s,
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
