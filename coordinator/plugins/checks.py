"""Checks of plug-ins in a process of their own, with a time limit.

A plug-in is other people's code: it may run without end, or end its process. The check
before a run, and ``revolve check``, therefore start a process that reports each step as
a line of JSON and ends when a check takes too long.
"""

import faulthandler
import json
import math
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from itertools import chain
from pathlib import Path
from typing import IO

from coordinator.arena.rules import load_rules
from coordinator.evolution.encodings import encoding_of
from coordinator.evolution.rules import check_rules
from coordinator.islands.learning import IslandLearning
from coordinator.storage.campaign import (
    campaign_plugins,
    checked_experiments,
    is_campaign,
    read_campaign,
)
from coordinator.storage.folder import holds_run, read_details
from schema.agent.import_path import environment, python_command
from schema.agent.log import warn_user
from schema.errors import (
    ExperimentError,
    RevolveError,
    UnknownPlugin,
    naming,
    nearest,
    one_line,
    shown,
)
from schema.experiment.document import (
    Experiment,
    body_space,
    island_experiments,
    references,
)
from schema.experiment.file import Draft, experiment_from_text, read_draft
from schema.experiment.fitness_keys import check_fitness_keys
from schema.experiment.kinds import Kind, Use, kind_of, uses
from schema.parts import BUILT_IN
from schema.plugins.kept import allow_kept
from schema.plugins.load import load_object, place_of
from schema.plugins.permission import FLAG, allow, allow_references, allowed, is_own
from schema.tables.description import allow_plugins_of

LIMIT_S = 30.0
"""CPU time for the import, and for the check, of one plug-in [s]."""
_WAITED = 4.0
"""Limit of the time on the clock, in limits of CPU time: a machine may be busy."""
HERE = "--here"
"""Flag of ``revolve check`` in the process that does the checks, with their limit."""
BIRTHS = "--births"
FROM = "--from"
"""Flags of the same process, as of ``revolve run``."""
# What ``faulthandler`` writes for each thread when time is up; the main one is last.
_LATE = re.compile(
    r'^(?:Current t|T)hread .* first\):\n *File "([^"]*)", line (\d+)', re.MULTILINE
)

_PLACE = re.compile(r"\.py:\d")


def refuse_faulty(
    drafts: Iterable[tuple[str, Draft]],
    births: int | None = None,
    run: str | None = None,
) -> None:
    """Check the plug-ins of experiments before a run, in a process of their own.

    Built-in plug-ins are not checked: the tests of this project do that.

    Raises:
        ExperimentError: a plug-in that is not in order, or an invalid experiment.
    """
    own = [word for word, draft in drafts if any(map(is_own, draft.references))]
    if own:
        flags = ((BIRTHS, births), (FROM, run))
        given = [(flag, str(value)) for flag, value in flags if value is not None]
        _refuse([*own, *chain(*given)])


def refuse_faulty_of(folder: Path) -> tuple[Experiment, ...]:
    """Check the plug-ins of a folder that is resumed; return its experiments.

    Raises:
        ExperimentError: as of ``refuse_faulty``; another plug-in than at the beginning.
    """
    experiments = _experiments_of(folder)
    if any(is_own(path) for each in experiments for path in references(each)):
        _refuse([str(folder)])
    return experiments


def _refuse(words: Sequence[str]) -> None:
    if problems := check_apart(words, warn=warn_user):
        raise ExperimentError(problems[0])


def _experiments_of(folder: Path) -> tuple[Experiment, ...]:
    """Return the experiments of a run or campaign folder; allow its plug-ins."""
    if not is_campaign(folder):
        allow_plugins_of(folder, is_resumed=True)
        return (experiment_from_text(read_details(folder).document, is_own=True),)
    allow_kept(folder, campaign_plugins(folder), is_resumed=True)
    experiments = read_campaign(folder).experiments
    for experiment in experiments:
        allow_references(references(experiment))
    return experiments


def check_built_in(experiment: Experiment, kinds: Sequence[Kind]) -> None:
    """Raise unless built-in plug-ins exist and take the parameters of an experiment.

    Its own plug-ins are not imported.

    Raises:
        ExperimentError: a name or parameters that are not allowed.
    """
    for use in uses(experiment, kinds):
        if is_own(use.path):
            continue
        try:
            use.check()
        except ExperimentError as error:
            # An island may have a table of the top level.
            is_inherited = experiment.islands and experiment.fitness.parameters
            if not (is_inherited and str(error).startswith("fitness.parameters")):
                raise
            hint = "'parameters = {}' in [islands.fitness] replaces those of [fitness]"
            raise type(error)(f"{error}; {hint}") from None
    for own in island_experiments(experiment):
        if own.arena is not None and not is_own(own.arena.rules):
            load_rules(own)
        check_rules(own)
        if not is_own(own.fitness.function):
            check_fitness_keys(own)
        if own.learning is not None:
            IslandLearning(own, encoding_of(own))
        elif not is_own(own.encoding.type):
            encoding_of(own)


def check_apart(
    words: Sequence[str],
    tell: Callable[[str], None] = lambda _: None,
    limit_s: float = LIMIT_S,
    warn: Callable[[str], None] = lambda _: None,
) -> list[str]:
    """Check plug-ins in a process of their own; return a line for each faulty one.

    ``tell`` gets a line for each plug-in in order, ``warn`` one for each warning; an
    import, and a check, may each take ``limit_s`` of CPU time [s].
    """
    flags = [HERE, str(limit_s)]
    for entry in allowed():
        flags += [FLAG, entry]
    child = subprocess.run(  # noqa: S603 - our own interpreter
        [*python_command("revolve"), "check", *words, *flags],
        env=environment(),
        capture_output=True, text=True, errors="replace", check=False,
    )  # fmt: skip
    problems: list[str] = []
    begun = ""
    # A plug-in that several experiments name is checked for each, and named once.
    told: set[str] = set()
    for line in child.stdout.splitlines():
        step, text = json.loads(line)
        begun = text if step == "begin" else ""
        if step in ("fine", "warn"):
            if text not in told:
                (tell if step == "fine" else warn)(text)
            told.add(text)
        elif step == "fault":
            problems.append(text)
    if not begun and child.returncode == (1 if problems else 0):
        return problems
    if threads := _LATE.findall(child.stderr):
        file, line = threads[-1]
        place = f"{Path(file).name}:{line}"
        most = f"{limit_s:g} s of CPU time, and {_WAITED * limit_s:g} s in all"
        why = f"must take at most {most}, but was still at {place}"
    elif begun:
        why = f"must not end its process, but did, with status {child.returncode}"
    else:
        why = child.stderr.strip()[-200:] or f"exit status {child.returncode}"
    return [*problems, f"{begun or 'revolve check'}: {why}"]


def check_here(
    words: Sequence[str],
    kinds: Sequence[Kind],
    kind: str | None,
    output: IO[str],
    limit_s: float,
    *,
    read: Callable[[str], Draft] = read_draft,
    read_founders: Callable[[Sequence[Experiment]], object] = lambda _: None,
) -> bool:
    """Check plug-ins in this process; return whether all are in order.

    The words are as of ``revolve check``; their kind is detected unless it is named.
    The output gets the steps as lines of JSON. Documents are read by ``read``, and
    their given founders by ``read_founders``.
    """
    is_fine = True

    def say(step: str, text: str) -> None:
        output.write(f"{json.dumps([step, text])}\n")
        output.flush()

    # A plug-in may print.
    with redirect_stdout(sys.stderr):
        for word in words:
            try:
                say("begin", word)
                with _time_limit(limit_s):
                    own = _uses(word, kinds, kind, read)
                for use in own:
                    with _time_limit(limit_s), _placing(word, use):
                        _check_plugin(use, say)
                if ":" not in word and not _is_folder(Path(word)):
                    experiments = checked_experiments([(word, read(word))])
                    for warning in _check_document(word, experiments, kinds, limit_s):
                        say("warn", f"{word}: warning: {warning}")
                    read_founders(experiments)
                if not own:
                    say("fine", f"{word}: in order, no plug-ins of its own")
            except RevolveError as error:
                is_fine = False
                say("fault", one_line(error))
    return is_fine


def _check_plugin(use: Use, say: Callable[[str, str], None]) -> None:
    """Check a plug-in; say that it is in order, and what to beware of."""
    key = use.kind.key
    say("begin", f"{key}: {use.path}")
    where, warning = use.check(lambda place: say("begin", f"{key}: {place}"))
    say("fine", f"{use.path}: {use.kind.name} at {where}: in order")
    if warning:
        say("warn", f"{key}: {where}: warning: {warning}")


def _check_document(
    source: str,
    experiments: Iterable[Experiment],
    kinds: Sequence[Kind],
    limit_s: float,
) -> Iterator[str]:
    """Raise what a run would refuse besides own plug-ins; yield warnings."""
    for experiment in experiments:
        with _time_limit(limit_s), naming(source):
            check_built_in(experiment, kinds)
            for own in island_experiments(experiment):
                check_fitness_keys(own)
            types = body_space(experiment.space)
        for kind in types.values():
            for name in kind.not_on:
                if name not in types and name not in BUILT_IN:
                    unknown = f"no part type is named {shown(name)}"
                    near = nearest(name, types)
                    yield f"space.part_types: {kind.name}.not_on: {unknown}{near}"


def _is_folder(folder: Path) -> bool:
    return is_campaign(folder) or holds_run(folder)


@contextmanager
def _placing(word: str, use: Use) -> Iterator[None]:
    """Name file and line in an error: of the plug-in, its name, or another key."""
    try:
        yield
    except ExperimentError as error:
        story = one_line(error)
        if not word.endswith(".toml") or _PLACE.search(story):
            raise
        key = story.partition(":")[0]
        is_named = key == use.kind.key
        leaf = re.escape(key.rpartition(".")[2])
        sought = re.escape(use.path) if is_named else rf"^\s*{leaf}\s*="
        lines = enumerate(Path(word).read_text("utf-8").splitlines(), 1)
        found = [number for number, line in lines if re.search(sought, line)]
        # Another section may have a key of the same name.
        place = f":{found[0]}" if (is_named and found) or len(found) == 1 else ""
        raise ExperimentError(f"{Path(word).name}{place}: {story}") from error


@contextmanager
def _time_limit(limit_s: float) -> Iterator[None]:
    """End this process if the block takes too long."""
    # Neither needs the interpreter: a plug-in may be in foreign code.
    faulthandler.dump_traceback_later(_WAITED * limit_s, exit=True)
    signal.signal(signal.SIGXCPU, signal.SIG_DFL)
    faulthandler.register(signal.SIGXCPU, chain=True)
    before, most = resource.getrlimit(resource.RLIMIT_CPU)
    end_s = math.ceil(time.process_time() + limit_s)
    resource.setrlimit(resource.RLIMIT_CPU, (end_s, most))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_CPU, (before, most))
        faulthandler.unregister(signal.SIGXCPU)
        faulthandler.cancel_dump_traceback_later()


def _uses(
    word: str, kinds: Sequence[Kind], kind: str | None, read: Callable[[str], Draft]
) -> list[Use]:
    """Return the own plug-ins that a word of the command line means."""
    place, colon, attribute = word.rpartition(":")
    if word.endswith(".py"):
        raise ExperimentError(f"{word}: name a function or class: {word}:NAME")
    if not colon:
        folder = Path(word)
        experiments = (
            _experiments_of(folder) if _is_folder(folder) else read(word).allowed()
        )
        named = [use for each in experiments for use in uses(each, kinds)]
        return [use for use in dict.fromkeys(named) if is_own(use.path)]
    path = word
    if place.endswith(".py"):
        allow([place])
        path = f"{Path(place).stem}:{attribute}"
    else:
        allow_references([path], Path())
    plugin: object = load_object(path, "revolve check", {})
    by_name = {each.name: each for each in kinds}
    found = by_name[kind] if kind else kind_of(plugin, kinds)
    if found is None:
        names = ", ".join(each.name for each in kinds)
        got = f"got a {type(plugin).__name__}; --kind says which"
        rule = f"must be of one of the kinds {names}"
        raise UnknownPlugin(f"{path}: {place_of(path)}: {rule}, {got}")
    return [Use(found, found.section(path))]
