"""Scores of experiments in the suite: their files, intervals and comparison."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from msgspec.structs import replace

from analysis.comparison.comparison import correct, known, two_samples
from analysis.comparison.statistics import ALPHA, median_interval
from revolve.suite.protocol import Protocol
from schema.errors import RevolveError, shown
from schema.plugins.bounded import text_of

Row = dict[str, Any]

WINDOWS = ("first", "later")
REFERENCES = ("no-reproduction", "scenario1")
"""Shipped scores, of random search and of the thesis's evolution."""
_HEAD = f"{'task':20}{'window':10}{'a':9}{'b':5}{'mean a - b, 95 % interval':28}"
_HEAD += f"{'delta, 95 % interval':23}{'q':8}"
_LINE = "{task:19} {window:5}  {median_a:7.4f} {median_b:7.4f}  {difference:+7.4f}, "
_LINE += "{difference_low:+.4f} to {difference_high:+.4f}  {effect:+.2f}, "
_LINE += "{effect_low:+.2f} to {effect_high:+.2f}  {q:.4f}  {verdict}"


class TaskScore(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Scores of one task; lists have one number per run.

    Attributes:
        evaluations: evaluations of the run, trials of learning included.
        first: fitness of its best robot ever in the first window; 0 of a failure.
        later: mean fitness of that robot in the later windows.
        medians: median between the ends of its exact 95 % interval, by window.
        against: comparison with each reference, by its name and window.
    """

    evaluations: list[int]
    first: list[float]
    later: list[float]
    medians: dict[str, list[float | None]] = {}
    against: dict[str, dict[str, Row]] = {}


class Score(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Scores of one experiment.

    Attributes:
        name: of the experiment.
        experiment: its settings, without those that the tasks replace.
        version: of the suite.
        protocol: digest of the protocol.
        revolve: version of the toolkit.
        tasks: scores by task.
    """

    name: str
    experiment: Row
    version: int
    protocol: str
    revolve: str
    tasks: dict[str, TaskScore]


def completed(score: Score, references: Mapping[str, Score]) -> Score:
    """Return a score with intervals of its medians, and compared with others."""
    tasks = {}
    for task, own in score.tasks.items():
        medians, against = {}, dict[str, dict[str, Row]]()
        for window in WINDOWS:
            values = np.array(getattr(own, window))
            low, high = median_interval(values)
            medians[window] = [*map(_short, (low, np.median(values), high))]
            for name, other in references.items():
                row = _compared(own, other.tasks[task], window)
                shorter = {key: _short(value) for key, value in row.items()}
                against.setdefault(name, {})[window] = shorter
        tasks[task] = replace(own, medians=medians, against=against)
    return replace(score, tasks=tasks)


def _compared(a: TaskScore, b: TaskScore, window: str) -> Row:
    return two_samples(*(np.array(getattr(each, window)) for each in (a, b)))


def _short(value: float | None) -> float | None:
    """Return a number with six digits, in which libraries agree; None for NaN."""
    return None if value is None else known(float(f"{value:.6g}"))


def score_text(score: Score) -> str:
    """Return the content of a score's file: JSON with sorted keys."""
    data = msgspec.json.encode(score, order="sorted")
    return msgspec.json.format(data, indent=1).decode() + "\n"


def read_score(source: str, protocol: Protocol) -> Score:
    """Return the score of a file, or of a reference by its name.

    Raises:
        RevolveError: no such file, no score, or one of another protocol.
    """
    shipped = {name: Path(__file__).with_name(f"{name}.json") for name in REFERENCES}
    names, path = ", ".join(shipped), shipped.get(source, Path(source))
    text = text_of(path, source, f"; shipped are {names}", kind=RevolveError)
    try:
        score = msgspec.json.decode(text, type=Score)
    except (msgspec.DecodeError, RecursionError) as error:
        raise RevolveError(f"{source}: not a score of the suite: {error}") from None
    if (score.version, score.protocol) != (protocol.version, protocol.digest):
        rule = f"must be of protocol {protocol.version}, {protocol.digest[:8]}"
        got = f"got {score.version}, {shown(score.protocol[:8])}"
        raise RevolveError(f"{source}: {rule}, {got}")
    tasks = score.tasks.values()
    counts = {len(runs) for t in tasks for runs in (t.evaluations, t.first, t.later)}
    if counts != {protocol.repeats} or score.tasks.keys() != protocol.tasks.keys():
        rule = f"{protocol.repeats} runs of each of {', '.join(protocol.tasks)}"
        raise RevolveError(f"{source}: must have {rule}")
    return score


def comparison_lines(a: Score, b: Score) -> Iterator[str]:
    """Yield the lines of a table that compares two scores by task and window."""
    for letter, score in (("a", a), ("b", b)):
        evaluations = sum(sum(own.evaluations) for own in score.tasks.values())
        yield f"{letter}: {score.name}, {evaluations} evaluations"
    yield _HEAD
    rows = [
        {"task": task, "window": window, **_compared(own, b.tasks[task], window)}
        for task, own in a.tasks.items()
        for window in WINDOWS
    ]
    for row in correct(rows):
        better = "a is better" if row["effect"] > 0 else "b is better"
        verdict = better if row["q"] < ALPHA else "no difference shown"
        yield _LINE.format(**row, verdict=verdict)
