"""A suite of seconds: ``python -m tests.system.tiny_suite EXPERIMENT.toml FOLDER``."""

import sys
from pathlib import Path

from msgspec.structs import replace

from revolve.suite.protocol import Protocol, read_protocol
from revolve.suite.runs import evolve, score_runs
from revolve.suite.score import completed, score_text

STEPS = 400


def tiny() -> Protocol:
    """Return a protocol of two tasks, two runs each, with windows of two seconds."""
    whole = read_protocol()
    tasks = {name: whole.tasks[name] for name in ("locomotion", "turning")}
    simulation = whole.fixed["simulation"] | {"window_steps": STEPS}
    fixed = whole.fixed | {"simulation": simulation}
    return replace(whole, repeats=2, births=8, tasks=tasks, fixed=fixed)


if __name__ == "__main__":
    _, source, place = sys.argv
    wanted = (tiny(), source, Path(place), 1)
    if code := evolve(*wanted):
        sys.exit(code)
    score = completed(score_runs(*wanted), {})
    Path(place, "score.json").write_text(score_text(score))
