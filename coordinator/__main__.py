"""Commands of the coordinator: runs, their comparison, plug-ins."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from itertools import chain
from pathlib import Path

import schema.experiment.kinds
from coordinator.arena.kinds import RULES
from coordinator.cli.deployment import Deployment
from coordinator.cli.execute import (
    finished_code,
    lengthen_all,
    resume,
    start,
    start_campaign,
)
from coordinator.cli.flags import parser as run_flags
from coordinator.cli.flags import resume_flags
from coordinator.cli.founders import with_founders
from coordinator.cli.groups import (
    archipelago_of,
    check_groups,
    execute_groups,
    groups_below,
    start_groups,
)
from coordinator.dispatch.events import AgentKind
from coordinator.evolution import newborns
from coordinator.evolution.check_encoding import check_brain_genes
from coordinator.evolution.kinds import KINDS, brain_kind
from coordinator.plugins.checks import check_built_in, refuse_faulty, refuse_faulty_of
from coordinator.plugins.command import (
    check,
    check_flags,
    cost_line,
    list_flags,
    list_plugins,
)
from coordinator.run.cross_checks import Checks
from coordinator.storage.campaign import (
    Campaign,
    checked_experiments,
    is_campaign,
    joined_name,
    read_drafts,
    shipped_campaigns,
)
from coordinator.storage.compare import compare
from coordinator.storage.folder import holds_run, read_details
from coordinator.storage.hints import command as command_line
from coordinator.storage.hints import stopped
from schema.agent.address import HUB
from schema.agent.command import (
    access_of,
    agent_of,
    check_load,
    connect_of,
    listen_of,
    tls_of,
)
from schema.agent.extras import install_advice
from schema.agent.flags import Flags
from schema.agent.import_path import missing_screen
from schema.agent.log import start_log, tell_user, warn_user
from schema.agent.machine import memory_bytes, shards_that_fit
from schema.agent.request_handler import Compute
from schema.agent.service import HubLost
from schema.agent.stopping import STOPPED, advise, tell_stopped
from schema.agent.supervisor import cores
from schema.agent.topics import check_name
from schema.errors import ExperimentError, NetworkError
from schema.experiment.document import Experiment, island_count, island_experiments
from schema.experiment.identity import WHOLE, Group
from schema.experiment.kinds import Kind
from schema.limits import MOST_REPEATS
from schema.plugins.permission import FLAG, allow
from schema.tables.arrow import skip_pandas
from schema.tables.description import KeptFounder

# Flags that --in-process excludes.
_OF_NETWORK = (
    *("access", "connect", "fleet", "listen", "view", "give-up-after"),
    *("tls-ca", "tls-certificate", "tls-key"),
    *("cpu-limit", "wait-limit", "oversubscribe"),
)


def main(arguments: list[str]) -> int:
    """Run one of the coordinator's commands, named first, and return its exit code.

    Returns:
        0 for success; 1 if ``compare`` found a difference, a plug-in is refused, a run
        of a campaign failed, or all evaluations failed; 130 after a stop signal.
    """
    command, words = arguments[0], arguments[1:]
    if command == "check":
        return check(words, plugin_kinds(), _with_founders)
    if command == "plugins":
        return list_plugins(words, plugin_kinds())
    flags = run_flags(command)
    options = flags.parse_args(words)
    skip_pandas()
    if command == "compare":
        return _compare(options)
    start_log("coordinator", as_json=options.log_json)
    allow(options.plugins)
    if not options.in_process and options.command != "coordinator":
        check_load(flags, "--workers", options.workers or 0, options)
    if command == "resume":
        return _resume(options)
    experiments, founders = _experiments(options)
    is_campaign_wanted = len(experiments) > 1 or _is_repeated(options)
    is_shipped = is_campaign_wanted and options.experiments[0] in shipped_campaigns()
    name = "+".join(options.experiments) if is_shipped else joined_name(experiments)
    folder = Path(options.out or Path("runs") / f"{name}-seed{options.seed}")
    group, of = _groups(options, experiments)
    if group.of > 1 and not options.out:
        folder /= f"group-{group.number}"
    deployment = _deployment(options, experiments, folder)
    repeats, first = options.repeats or 1, options.first_repeat or 0
    if (count := first + repeats) > MOST_REPEATS:
        also = " with those before --first-repeat" if first else ""
        flags.error(f"--repeats: must be <= {MOST_REPEATS}{also}, got {count}")
    campaign = Campaign(experiments, repeats, options.seed, first, founders, group)
    if group.of > 1:
        given = options.archipelago or archipelago_of(campaign)
        campaign = replace(campaign, archipelago=given)
    begin = start_campaign if is_campaign_wanted else start
    if of > 1:
        commands = start_groups(folder, campaign, of, _births_of(options))
        go = partial(execute_groups, folder, commands, deployment, main)
        return _stoppable(folder, deployment, go)
    return _stoppable(folder, deployment, lambda: begin(folder, campaign, deployment))


def parser(command: str) -> Flags:
    """Return the parser of one of the coordinator's commands."""
    if command == "check":
        return check_flags(plugin_kinds())
    return list_flags() if command == "plugins" else run_flags(command)


def plugin_kinds() -> tuple[Kind, ...]:
    """Return all kinds of plug-ins; imports the room of the worker."""
    import worker.kinds
    from worker.robot.brains import load_controls

    def check_brain(experiment: Experiment) -> None:
        check_brain_genes(experiment)
        # Its check runs when it is made.
        tick_s = experiment.simulation.tick_s
        load_controls(experiment.brain, experiment.space, tick_s)

    return (
        *schema.experiment.kinds.KINDS,
        *worker.kinds.KINDS,
        *KINDS,
        RULES,
        brain_kind(check_brain),
    )


def _groups(
    options: argparse.Namespace, experiments: Sequence[Experiment]
) -> tuple[Group, int]:
    """Return the group of islands to run, and how many groups to start here."""
    if options.command == "run":
        of = options.coordinators or 1
        if of > 1:
            _refuse_for_groups(options)
            check_groups(
                experiments, of, "--coordinators", is_repeated=_is_repeated(options)
            )
        return WHOLE, of
    group: Group = options.group
    if group.of > 1:
        check_groups(
            experiments, group.of, "--group", is_repeated=_is_repeated(options)
        )
        if not options.connect:
            raise NetworkError(
                "--group: needs --connect: no group is the hub of the others; start "
                "one (revolve hub)"
            )
    elif options.archipelago:
        raise NetworkError("--archipelago: has no effect without --group")
    if options.archipelago:
        check_name(options.archipelago, "--archipelago")
    return group, 1


def _refuse_for_groups(options: argparse.Namespace) -> None:
    """Raise if a flag has no meaning for several coordinators."""
    for flag in ("in-process", "view", "metrics"):
        if getattr(options, flag.replace("-", "_")):
            raise NetworkError(f"--{flag}: excludes several coordinators")


def _births_of(options: argparse.Namespace) -> list[str]:
    """Return the words of the command line that determine births."""
    words = [*options.experiments, "--seed", str(options.seed)]
    if options.births is not None:
        words += ["--births", str(options.births)]
    if options.founders is not None:
        words += ["--from", options.founders]
    return [*words, *(word for each in options.plugins for word in (FLAG, each))]


def _resume(options: argparse.Namespace) -> int:
    folder = Path(options.folder)
    groups = groups_below(folder, options.births)
    runs = groups or [folder]
    # First: a finished run needs none of its plug-ins.
    if options.births is None and (code := finished_code(folder, groups)) is not None:
        return code
    experiments = refuse_faulty_of(runs[0])
    if options.births is not None:
        for run in runs:
            lengthen_all(run, options.births)
        if (code := finished_code(folder, groups)) is not None:
            return code
    if groups:
        _refuse_for_groups(options)
    deployment = _deployment(options, experiments, folder)
    if groups:
        commands = {
            each: (read_details(each), ["resume", str(each)]) for each in groups
        }
        go = partial(execute_groups, folder, commands, deployment, main)
        return _stoppable(folder, deployment, go)
    return _stoppable(folder, deployment, lambda: resume(folder, deployment))


def _stoppable(folder: Path, deployment: Deployment, execute: Callable[[], int]) -> int:
    """Execute a folder's runs; after Ctrl-C say how to resume them."""
    flags = deployment.resume_flags
    try:
        return execute()
    except HubLost as error:
        again = f"; to resume: {command_line('resume', folder, *flags)}"
        tell_user(f"{error}{again if _has_begun(folder) else ''}")
        return 1
    except KeyboardInterrupt:
        if _has_begun(folder):
            advise(stopped(folder, flags))
        tell_stopped()
        return STOPPED


def _has_begun(folder: Path) -> bool:
    begun = is_campaign(folder) or holds_run(folder)
    return begun or (folder / "group-0").exists()


def _experiments(
    options: argparse.Namespace,
) -> tuple[tuple[Experiment, ...], dict[str, KeptFounder]]:
    """Return checked experiments and their founders; imports the worker's room."""
    import worker.kinds

    drafts = read_drafts(options.experiments, options.births, options.founders)
    refuse_faulty(drafts, options.births, options.founders)
    check = partial(check_built_in, kinds=worker.kinds.KINDS)
    found = checked_experiments(drafts, check)
    islands = (own for each in found for own in island_experiments(each))
    for line in dict.fromkeys(filter(None, map(cost_line, islands))):
        warn_user(line)
    return _with_founders(found)


def _with_founders(
    experiments: Sequence[Experiment],
) -> tuple[tuple[Experiment, ...], dict[str, KeptFounder]]:
    """Return experiments and founders; imports the room of the analyzer."""
    import analyzer.report

    return with_founders(experiments, analyzer.report.analyze)


def _deployment(
    options: argparse.Namespace, experiments: tuple[Experiment, ...], folder: Path
) -> Deployment:
    """Return processes and network; imports the rooms of worker and analyzer."""
    import analyzer.report
    import analyzer.service
    import worker.serve.service
    from worker.arena.world import World
    from worker.serve.jobs import Jobs
    from worker.serve.shards import Shards

    islands = chain(*map(island_experiments, experiments))
    any_arena = any(own.arena is not None for own in islands)
    if not any_arena:
        _refuse_flags_of_arenas(options, experiments)
    if options.view:
        _check_window(folder)
    if options.connect and options.listen:
        raise NetworkError("--listen and --connect exclude each other")
    for flag in _OF_NETWORK if options.in_process else ():
        name = flag.replace("-", "_")
        if getattr(options, name) != run_flags(options.command).get_default(name):
            raise NetworkError(f"--{flag} has no effect with --in-process")
    if options.in_process and options.command != "coordinator" and options.workers:
        raise NetworkError("--workers: --in-process starts no other processes")
    tls = None if options.in_process else tls_of(options)
    listen = options.listen
    if options.command == "coordinator" and not options.connect:
        listen = listen or HUB
    workers: int | None = options.workers
    if workers is None:
        workers = 0 if options.connect else cores()
    # An arena that is small runs in one process; several arenas spread over them.
    is_alone = len(experiments) == 1 and island_count(experiments[0]) == 1
    is_one_arena = is_alone and any_arena and not _is_repeated(options)
    threads = options.threads or (cores() if is_one_arena else 1)
    most_held = shards_that_fit(memory_bytes(), processes=1)
    shards = Shards(World, most_held=most_held, threads=threads)
    breed = partial(newborns.breed, vet=analyzer.report.analyze)
    answers: dict[AgentKind, Compute] = {
        "analyzer": breed,
        "worker": Jobs(shards).answer,
    }
    agent = agent_of(options, "worker", "own-worker", tls=tls)
    return Deployment(
        replace(agent, threads=threads),
        workers=workers,
        bodies={
            "analyzer": partial(analyzer.service.process, breed),
            "worker": worker.serve.service.process,
        },
        answers=answers if options.in_process else None,
        listen=listen_of([listen], tls)[0] if listen else None,
        connect=connect_of(options) if options.connect else None,
        certificates=access_of(options),
        quiet=options.quiet,
        fsync=options.fsync,
        speed=options.speed,
        arena_workers=options.arena_workers,
        view=options.view,
        checks=Checks(options.audit, options.on_quarantine == "pause", breed),
        allows_drift=options.allow_drift,
        metrics=options.metrics,
        resume_flags=tuple(resume_flags(options)),
    )


def _refuse_flags_of_arenas(
    options: argparse.Namespace, experiments: tuple[Experiment, ...]
) -> None:
    names = ", ".join(experiment.name for experiment in experiments)
    for flag in ("speed", "arena-workers"):
        if getattr(options, flag.replace("-", "_")) is not None:
            raise ExperimentError(
                f"--{flag}: is for arenas, and there is none in {names}"
            )


def _check_window(folder: Path) -> None:
    """Raise unless ``--view`` can open a window."""
    if find_spec("rerun") is None:
        raise NetworkError(
            f"--view: the viewer is not installed: {install_advice('view')}"
        )
    if why := missing_screen():
        beside = command_line("view", "--connect", folder, "--serve")
        raise NetworkError(f"--view: {why}: run without it, and beside it: {beside}")


def _is_repeated(options: argparse.Namespace) -> bool:
    """Return whether repeats make a campaign; ``resume`` has no such flags."""
    counts = (getattr(options, name, None) for name in ("repeats", "first_repeat"))
    return any(count is not None for count in counts)


def _compare(options: argparse.Namespace) -> int:
    differences = compare(Path(options.first), Path(options.second))
    for line in differences:
        print(line)
    if not differences:
        print("equal in all repeatable columns")
    return 1 if differences else 0
