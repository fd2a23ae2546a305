"""Summaries of experiments, runs, arenas and speed."""

from collections.abc import Collection, Mapping, Sequence
from html import escape
from statistics import mean, median

import pyarrow as pa

from analysis.figures.forms import Row, Tables
from analysis.figures.style import colours, in_order, label
from analysis.measures.fitness_functions import axis_text, functions_of
from analysis.measures.populations import last_rows
from analysis.measures.winners import sustained_shares
from analysis.report.fitness import run_names
from analysis.report.html import cell, duration, folded, named, table
from schema.errors import counted

_MOST_LINES = 3
"""Differing experiments, or runs of arenas, that are described without a fold."""
_MOST_TEXT = 800
"""Characters of HTML about differing experiments that are shown without a fold."""


def summary(tables: Tables) -> str:
    """Return one row per experiment: runs, births, fitness, time, failures."""
    runs = tables["runs"].to_pylist()
    fitness = _last_fitness(tables["populations"])
    sustained = sustained_shares(tables["robots"])
    names = in_order(row["experiment"] for row in runs)
    paint = colours(names)
    functions = functions_of(tables["runs"])
    has_functions = len(set(functions.values())) > 1
    heads = ["experiment", *(["fitness function"] if has_functions else []), "runs",
             "births of a run", "best fitness", "sustained", "mean of bests",
             "mean of populations",
             "time of a run", "failures"]  # fmt: skip
    rows = []
    for name in names:
        mine = [row for row in runs if row["experiment"] == name]
        known = [fitness[row["folder"]] for row in mine if row["folder"] in fitness]
        times = [row["duration_s"] for row in mine if row["duration_s"] is not None]
        failures = [row["failures"] for row in mine if row["failures"] is not None]
        births = sorted({row["births"] for row in mine})
        cells = [
            f'<td class="name">{named(name, paint[name])}</td>',
            *([cell(_with_unit(functions[name]))] if has_functions else []),
            cell(_states(mine)),
            cell(
                str(births[0]) if len(births) == 1 else f"{births[0]} to {births[-1]}"
            ),
            cell(max((best for best, _ in known), default=None)),
            cell(
                _percent(
                    [
                        share
                        for (folder, _), share in sustained.items()
                        if folder in {row["folder"] for row in mine}
                    ]
                )
            ),
            *(
                cell(mean(pair[at] for pair in known) if known else None)
                for at in range(2)
            ),
            cell(duration(mean(times) if times else None)),
            cell(sum(failures) if failures else None),
        ]
        rows.append(cells)
    if not rows:
        return ""
    return (
        table(heads, rows)
        + _differing({row["experiment"]: row["differs"] for row in runs})
        + _summary_note(
            set(functions.values()), has_islands=any(row["islands"] > 1 for row in runs)
        )
    )


def _percent(shares: Sequence[float]) -> str | None:
    return f"{100 * median(shares):.0f} %" if shares else None


def _differing(differs: Mapping[str, str]) -> str:
    lines = [
        f"<p>{escape(label(name))}: {escape(text)}</p>"
        for name, text in differs.items()
        if text
    ]
    text = "".join(lines)
    if len(lines) > _MOST_LINES or len(text) > _MOST_TEXT:
        title = f"Settings that differ: {counted(len(lines), 'experiment')}"
        return folded(title, text)
    return text


def _with_unit(function: str) -> str:
    return axis_text(function, function)


def _states(runs: Sequence[Row]) -> str:
    # A folder does not say whether its run is still being executed.
    finished = [row["state"] == "finished" for row in runs].count(True)
    counts = {"finished": finished, "not finished": len(runs) - finished}
    return ", ".join(f"{count} {state}" for state, count in counts.items() if count)


def _summary_note(functions: Collection[str], *, has_islands: bool) -> str:
    text = (
        "Fitness of the last populations: the best robot of all runs, the mean over "
        "runs of each run's best robot, and the mean over runs of the mean of each "
        "run's population. Sustained is what the best robot of a run keeps of its "
        "fitness in the four windows after that of its evaluation, simulated alone; "
        "the median over runs. "
    )
    if has_islands:
        text += "A run of several islands counts with the mean of their means. "
    if len(functions) > 1:
        text += (
            "The experiments have different fitness functions: compare numbers only "
            "between rows with the same function."
        )
    elif any(functions):
        text += f"Fitness function: {', '.join(map(_with_unit, functions))}."
    return f'<p class="note">{escape(text)}</p>'


def arenas(tables: Tables) -> str:
    """Return a sentence about what happened in each run of arenas; empty for none."""
    names = run_names(tables["runs"])
    lines = []
    for row in tables["runs"].to_pylist():
        if row["simulated_s"] is None:
            continue
        alive = f"{row['arena_living']} were alive at the last birth"
        if row["islands"] == 1:
            alive = f"{row['births'] - row['deaths']} were alive at the end"
        born, place = counted(row["births"], "robot"), ""
        if row["arena_births"] < row["births"]:
            born, place = f"{row['arena_births']} of {born}", "in arenas, "
        lines.append(
            f"{names[row['folder']]}: {born} were born {place}in "
            f"{duration(row['simulated_s'])} of simulated time, {row['deaths']} died, "
            f"{alive}."
        )
    if not lines:
        return ""
    rule = (
        "In an arena, fitness is measured all the time; the fitness of a robot is that "
        "of its last window before the last birth. Robots that are not yet mature have "
        "none."
    )
    content = "".join(f"<p>{escape(line)}</p>" for line in lines)
    if len(lines) > _MOST_LINES:
        content = folded(f"Births and deaths in {len(lines)} runs of arenas", content)
    return f'{content}<p class="note">{rule}</p>'


def _last_fitness(populations: pa.Table) -> dict[str, tuple[float, float]]:
    islands: dict[str, list[tuple[float, float]]] = {}
    for row in last_rows(populations):
        if row["fitness"] is not None:
            both = row["fitness_best"], row["fitness"]
            islands.setdefault(row["folder"], []).append(both)
    return {
        folder: (max(best for best, _ in each), mean(value for _, value in each))
        for folder, each in islands.items()
    }


def all_runs(tables: Tables) -> str:
    """Return one row per run."""
    fitness = _last_fitness(tables["populations"])
    names = run_names(tables["runs"])
    rows = []
    for row in tables["runs"].to_pylist():
        best, average = fitness.get(row["folder"], (None, None))
        cells = (label(names[row["folder"]].experiment), row["run"], row["seed"],
                 row["state"], row["births"], row["islands"], best, average,
                 duration(row["duration_s"]), row["failures"],
                 row["folder"])  # fmt: skip
        rows.append([cell(value) for value in cells])
    heads = ("experiment", "run", "seed", "state", "births", "islands",
             "best of population", "mean of population", "time", "failures",
             "folder")  # fmt: skip
    return table(heads, rows)


def speed(tables: Tables) -> str:
    """Return the births per second of each experiment's runs."""
    rows = []
    runs = [row for row in tables["runs"].to_pylist() if row["duration_s"]]
    for name in in_order(row["experiment"] for row in runs):
        mine = [row for row in runs if row["experiment"] == name]
        rates = [row["births"] / row["duration_s"] for row in mine]
        times = [duration(each(r["duration_s"] for r in mine)) for each in (min, max)]
        spans = times[0] if len(mine) == 1 else f"{times[0]} to {times[1]}"
        cells = (label(name), len(mine), spans, mean(rates))
        rows.append([cell(value) for value in cells])
    if not rows:
        return ""
    note = (
        "Time from a run's start to its end, pauses included; runs of a campaign share "
        "the workers."
    )
    heads = ("experiment", "ended runs", "time of a run", "births per second of a run")
    return f"{table(heads, rows)}<p class=note>{escape(note)}</p>"
