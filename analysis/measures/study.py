"""Measures of many runs, computed in parallel processes."""

import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import repeat
from multiprocessing import active_children, get_context

import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.bodies import SlotRule
from analysis.measures.load import (
    TABLE,
    LeftOut,
    LoadedRun,
    read_duration_s,
    read_tables,
    records_touches,
)
from analysis.measures.measures import measure
from analysis.measures.named_measures import with_docstrings
from analysis.measures.outputs import run_schema, schema
from analysis.measures.run_tables import RunTables
from analysis.measures.winners import Evaluate, with_later_windows
from schema.errors import RevolveError
from schema.plugins.permission import allow, allowed
from schema.tables.description import run_columns


@dataclass(frozen=True, slots=True)
class MeasuredRun:
    """Measures of a run, by names of ``outputs``, and what could not be measured."""

    run: LoadedRun
    tables: dict[str, pa.Table]
    left_out: tuple[LeftOut, ...]


def measure_runs(
    runs: Sequence[LoadedRun],
    *,
    slots: SlotRule = "parent",
    processes: int = 1,
    evaluate: Evaluate | None = None,
) -> Iterator[MeasuredRun]:
    """Yield the measures of runs, in their order.

    With ``evaluate``, the best robot of each finished run is evaluated in later
    windows. Runs are measured in other processes, also one run: the memory of tables,
    of Numba and of what it compiles is free when figures are drawn.
    """
    try:
        pool = ProcessPoolExecutor(
            min(processes, len(runs)), get_context("spawn"), allow, (allowed(),)
        )
    except OSError:  # This system has no semaphores.
        yield from map(measure_run, runs, repeat(slots), repeat(evaluate))
        return
    with pool:
        try:
            yield from pool.map(measure_run, runs, repeat(slots), repeat(evaluate))
        except BaseException:
            # Not to wait for the runs that are being measured.
            for child in active_children():
                child.terminate()
            pool.shutdown(cancel_futures=True)
            raise


def measure_run(
    run: LoadedRun, slots: SlotRule, evaluate: Evaluate | None = None
) -> MeasuredRun:
    """Return the measures of one run, and what was left out."""
    tables, left_out = read_tables(run)
    folder = str(run.folder)
    shared = RunTables(tables, slots, run.islands)
    unread = frozenset(one.what.removeprefix(TABLE) for one in left_out)
    measures, problems = measure(shared, unread)
    if skipped := shared.population_table.incomplete:
        why = f"{skipped} populations skipped: the birth of a member is not recorded"
        left_out.append(LeftOut(folder, "populations", why))
    if not len(shared.population_table):
        left_out.append(LeftOut(folder, "measures", "no population is recorded"))
    if any(island.arena and not records_touches(island) for island in run.islands):
        why = "contacts are not recorded (arena.record_touches is false)"
        left_out.append(LeftOut(folder, "interactions", why))
    left_out += [LeftOut(folder, f"measure {one}", problems[one]) for one in problems]
    if not run.is_finished:
        born = tables["births"].num_rows
        planned = sum(island.births for island in run.islands)
        why = f"the run is not finished: {born} of {planned} births are recorded"
        left_out.append(LeftOut(folder, "comparison", why))
    if "named_measures" in measures:
        named_measures = with_docstrings(measures["named_measures"], run)
        measures["named_measures"] = named_measures
    if evaluate is not None and run.is_finished and "robots" in measures:
        try:
            robots = with_later_windows(measures["robots"], run, tables, evaluate)
            measures["robots"] = robots
        except RevolveError as error:
            left_out.append(LeftOut(folder, "measures of later windows", str(error)))
    named = {name: _named(rows, name, run) for name, rows in measures.items()}
    named["runs"] = _named(_summary(run, tables, unread), "runs", run)
    if run.point:
        named["sweeps"] = _named(_chosen(run), "sweeps", run)
    return MeasuredRun(run, named, tuple(left_out))


def _chosen(run: LoadedRun) -> pa.Table:
    rows = [
        {
            "setting": setting,
            "value": json.dumps(value),
            "number": value if type(value) in {int, float} else None,  # no bool
        }
        for setting, value in run.point.items()
    ]
    return pa.Table.from_pylist(rows, run_schema("sweeps"))


def _summary(
    run: LoadedRun, tables: Mapping[str, pa.Table], unread: frozenset[str]
) -> pa.Table:
    arenas = [number for number, island in enumerate(run.islands) if island.arena]
    has_arena = bool(arenas)
    born_there = pc.is_in(tables["births"]["island"], pa.array(arenas, pa.int32()))
    row = {
        "run": run.number,
        "seed": run.seed,
        "run_id": run_columns(run.folder)["run_id"],
        "state": run.state,
        "births": tables["births"].num_rows,
        "planned": sum(island.births for island in run.islands),
        "islands": len(run.islands),
        "differs": run.differs,
        "function": run.settings.fitness.function,
        "fitness_function": run.fitness,
        "plugins": " ".join(f"{name}={digest}" for name, digest in run.plugins.items()),
        "arena_births": (pc.sum(born_there).as_py() or 0) if has_arena else None,
        "arena_living": _living(tables["population"]) if has_arena else None,
        "deaths": tables["deaths"].num_rows if has_arena else None,
        "simulated_s": pc.max(tables["fitness"]["sim_time_s"]).as_py(),
        "failures": None if unread & {"evaluations", "deaths"} else _failures(tables),
        "duration_s": read_duration_s(run.folder),
    }
    return pa.Table.from_pylist([row], run_schema("runs"))


def _living(population: pa.Table) -> int:
    in_arenas = population.filter(pc.field("is_online"))
    last = in_arenas.group_by("island").aggregate([("births", "max")])
    here = in_arenas.join(last, "island")
    return int(pc.sum(pc.equal(here["births"], here["births_max"])).as_py() or 0)


def _failures(tables: Mapping[str, pa.Table]) -> int:
    failed = pc.equal(tables["evaluations"]["status"], "failed")
    diverged = pc.equal(tables["deaths"]["reason"], "diverged")
    return sum(pc.sum(column).as_py() or 0 for column in (failed, diverged))


def _named(table: pa.Table, name: str, run: LoadedRun) -> pa.Table:
    for column, value in (("experiment", run.experiment), ("folder", str(run.folder))):
        table = table.append_column(column, pa.repeat(value, table.num_rows))
    return table.select(schema(name).names).cast(schema(name))


def concatenated(measured: Sequence[MeasuredRun]) -> dict[str, pa.Table]:
    """Return the tables of several runs, concatenated, by name."""
    names = dict.fromkeys(name for one in measured for name in one.tables)
    return {
        name: pa.concat_tables(
            [one.tables[name] for one in measured if name in one.tables]
        )
        for name in names
    }


def reach(measured: MeasuredRun) -> int:
    """Return the number of births that every island of a run reaches."""
    judged = measured.tables["populations"].filter(pc.field("judged").is_valid())
    last = judged.group_by("island").aggregate([("births", "max")])
    return min(last["births_max"].to_pylist(), default=0)
