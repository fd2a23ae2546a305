"""Measures of many runs at a time, each in a process of its own."""

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np
import pyarrow as pa

from analysis.measures.load import TABLE, LeftOut, Run, read_tables
from analysis.measures.measures import measure
from analysis.measures.outputs import schema
from analysis.measures.run_tables import RunTables
from analysis.measures.trees import SlotRule

_FEW = 3
"""Runs that are measured before another process would have started."""


@dataclass(frozen=True, slots=True)
class Measured:
    """What was measured of a run.

    Attributes:
        run: which.
        tables: by name, with the columns of ``outputs``.
        left_out: what could not be read or measured.
    """

    run: Run
    tables: dict[str, pa.Table]
    left_out: tuple[LeftOut, ...]


def measure_runs(
    runs: Sequence[Run],
    *,
    slots: SlotRule = "parent",
    processes: int = 1,
    tell: Callable[[], None] = lambda: None,
) -> list[Measured]:
    """Return the measures of runs, in their order.

    Args:
        runs: which.
        slots: whose slot counts in tree edit distance.
        processes: how many runs at a time.
        tell: called when a run is done.
    """
    if processes == 1 or len(runs) <= _FEW:
        found = []
        for run in runs:
            found.append(measure_run(run, slots))
            tell()
        return found
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        futures = [pool.submit(measure_run, run, slots) for run in runs]
        try:
            for future in as_completed(futures):
                future.result()
                tell()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
        return [future.result() for future in futures]


def measure_run(run: Run, slots: SlotRule) -> Measured:
    """Return the measures of one run: reads, measures, names what was left out."""
    tables, left_out = read_tables(run)
    folder = str(run.folder)
    material = RunTables(tables, slots)
    unread = frozenset(one.what.removeprefix(TABLE) for one in left_out)
    found, refusals = measure(material, _wanted(run), unread)
    if material.population_table.lacking:
        why = f"{material.population_table.lacking} rows name a birth without a row"
        left_out.append(LeftOut(folder, "populations", why))
    if not len(material.population_table):
        left_out.append(LeftOut(folder, "measures", "no population is recorded"))
    if any(island.is_online and not island.records_touches for island in run.islands):
        why = "touches are not recorded (arena.record_touches is false)"
        left_out.append(LeftOut(folder, "interactions", why))
    left_out += [
        LeftOut(folder, f"measure {name}", refusals[name]) for name in refusals
    ]
    if not run.is_finished:
        born, planned = tables["births"].num_rows, planned_births(run)
        why = f"the run is not finished: {born} of {planned} births are there"
        left_out.append(LeftOut(folder, "comparison", why))
    named = {name: _named(found[name], name, run) for name in found}
    named["runs"] = _named(_summary(run, tables["births"]), "runs", run)
    return Measured(run, named, tuple(left_out))


def planned_births(run: Run) -> int:
    """Return how many births a run has when it is finished, of all islands."""
    return sum(island.births for island in run.islands)


def _wanted(run: Run) -> frozenset[str]:
    wanted = set()
    if any(island.is_online for island in run.islands):
        wanted.add("variability")
    if any(island.records_touches for island in run.islands):
        wanted.add("interactions")
    if len(run.islands) > 1:
        wanted |= {"between", "migrants"}
    return frozenset(wanted)


def _summary(run: Run, births: pa.Table) -> pa.Table:
    row = {
        "run": run.number,
        "seed": run.seed,
        "state": run.state,
        "births": births.num_rows,
        "planned": planned_births(run),
        "islands": len(run.islands),
        "differs": run.differs,
    }
    return pa.Table.from_pylist([row], schema("runs").remove(0).remove(0))


def _named(table: pa.Table, name: str, run: Run) -> pa.Table:
    """Return a table that says whose rows it holds, with the types of its output."""
    whose = {"experiment": run.experiment, "folder": str(run.folder)}
    for column, value in whose.items():
        repeated = pa.repeat(pa.scalar(value), table.num_rows)
        table = table.append_column(column, repeated)
    return table.select(schema(name).names).cast(schema(name))


def gathered(measured: Sequence[Measured]) -> dict[str, pa.Table]:
    """Return the tables of several runs, by name, one behind the other."""
    names = dict.fromkeys(name for one in measured for name in one.tables)
    return {
        name: pa.concat_tables(
            [one.tables[name] for one in measured if name in one.tables]
        )
        for name in names
    }


def reach(measured: Measured) -> int:
    """Return how many births every island of a run has a population for."""
    table = measured.tables["populations"].filter(
        measured.tables["populations"]["judged"].is_valid()
    )
    islands = np.asarray(table["island"], np.int64)
    births = np.asarray(table["births"], np.int64)
    return min(
        (int(births[islands == island].max()) for island in np.unique(islands)),
        default=0,
    )
