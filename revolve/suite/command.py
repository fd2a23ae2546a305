"""``revolve suite``: score experiments by a frozen protocol, and compare scores."""

import shlex
from pathlib import Path

from schema.agent.extras import extra
from schema.agent.flags import Flags, add_count
from schema.agent.stopping import advise
from schema.agent.supervisor import cores, most_processes

SCORE = "score.json"
"""Name of a score's file, in the folder of the runs."""


def main(arguments: list[str]) -> int:
    """Score an experiment, or compare two scores; return the exit code."""
    options = parser().parse_args(arguments[1:])
    with extra("revolve suite needs", "analysis"):
        from revolve.suite import score
    from revolve.suite.protocol import read_protocol

    protocol = read_protocol()
    if options.action == "compare":
        scores = [score.read_score(each, protocol) for each in (options.a, options.b)]
        print(*score.comparison_lines(*scores), sep="\n")
        return 0
    from coordinator.storage.disk import replace_text
    from revolve.suite.runs import evolve, score_runs

    references = {name: score.read_score(name, protocol) for name in score.REFERENCES}
    own = shlex.join(["revolve", *arguments])
    advise(f"stopped; to continue and to write the score: {own}", is_final=True)
    wanted = (protocol, options.experiment, options.out, options.workers or cores())
    if code := evolve(*wanted):
        return code
    scored = score.completed(score_runs(*wanted), references)
    replace_text(options.out / SCORE, score.score_text(scored))
    for reference in references.values():
        print("", *score.comparison_lines(scored, reference), sep="\n")
    print(f"\n{options.out / SCORE}: written")
    return 0


def parser(_command: str = "suite") -> Flags:
    """Return the parser of ``revolve suite``."""
    examples = (
        "revolve suite run --experiment mine.toml --out runs/mine",
        "revolve suite compare runs/mine/score.json scenario1",
        "revolve suite run --experiment novelty --out runs/novelty --workers 2",
        "revolve suite compare scenario1 no-reproduction",
    )
    about = "Score experiments by a frozen protocol, and compare scores."
    flags = Flags(prog="revolve suite", description=about, examples=examples)
    actions = flags.add_subparsers(dest="action", required=True, metavar="ACTION")
    for name, about, own in (
        ("run", "Run an experiment on all tasks, and write its score.", examples[::2]),
        ("compare", "Compare two scores, task by task.", examples[1::2]),
    ):
        actions.add_parser(name, description=about, help=about, examples=own)
    run, compare = actions.choices["run"], actions.choices["compare"]
    metavar, what = "NAME|FILE.toml", "experiment whose settings to use"
    run.add_argument("--experiment", required=True, metavar=metavar, help=what)
    where = f"folder to write to: runs and {SCORE}; runs in it are resumed"
    run.add_argument("--out", type=Path, required=True, metavar="FOLDER", help=where)
    about = "file of a score, or name of a shipped one"
    count = "number of workers, started on this machine (default: one per core)"
    add_count(run, "--workers", None, count, most=most_processes())
    for name in ("a", "b"):
        compare.add_argument(name, metavar=f"{name.upper()}.json", help=about)
    return flags
