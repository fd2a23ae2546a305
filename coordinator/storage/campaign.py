"""A campaign: several experiments, each repeated, in one folder.

``campaign.toml`` describes everything that determines its runs, so that the folder
alone is enough to resume it. Each run has an ordinary run folder below it, named after
experiment and repeat; a run that was made separately is used as it is.
"""

import dataclasses
import json
import tomllib
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from hashlib import sha256
from importlib import resources
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec.structs import replace

from coordinator.storage.disk import replace_bytes, replace_text
from coordinator.storage.folder import forget_plugins, holds_run
from coordinator.storage.hints import command, resume_command
from schema.errors import ExperimentError, RunFolderError, naming
from schema.experiment.document import Experiment
from schema.experiment.file import (
    Draft,
    check_source,
    experiment_from_text,
    experiment_text,
    read_draft,
    shipped_experiments,
)
from schema.experiment.identity import WHOLE, Group
from schema.limits import MOST_DESCRIPTION, MOST_REPEATS, printable, printable_line
from schema.plugins.kept import KeptPlugin, keep
from schema.tables.description import KeptFounder, RunDetails, read_small

CAMPAIGN = "campaign.toml"
_LONGEST_NAME = 100
"""Characters that the joined names of experiments have at most."""


@dataclass(frozen=True, slots=True)
class Campaign:
    """Description of a campaign.

    Attributes:
        experiments: experiments in the order of their runs; their names differ.
        repeats: number of runs of each experiment.
        seed: random seed of all runs; the run number selects the random streams.
        first: number of the first repeat; the others follow it.
        founders: given founders of all experiments, by digest.
        group, archipelago: of a single run, as of ``RunDetails``.
    """

    experiments: tuple[Experiment, ...]
    repeats: int
    seed: int
    first: int = 0
    founders: dict[str, KeptFounder] = field(default_factory=dict)
    group: Group = WHOLE
    archipelago: str = ""

    def runs(self, folder: Path) -> list[tuple[Path, RunDetails]]:
        """Return folder and details of each run, repeat by repeat."""
        runs = [
            RunDetails(
                each.name,
                repeat,
                self.seed,
                experiment_text(each),
                self.founders,
                self.group,
                self.archipelago,
            )
            for repeat in range(self.first, self.first + self.repeats)
            for each in self.experiments
        ]
        return [(folder / f"{each.name}-{each.run}", each) for each in runs]


def is_campaign(folder: Path) -> bool:
    """Return whether a folder holds a campaign."""
    return (folder / CAMPAIGN).exists()


def shipped_campaigns() -> dict[str, tuple[str, ...]]:
    """Return the names of the experiments of each shipped campaign."""
    folder = resources.files("coordinator") / "campaigns"
    return {
        entry.name.removesuffix(".toml"): tuple(
            tomllib.loads(entry.read_text(encoding="utf-8"))["experiments"]
        )
        for entry in sorted(folder.iterdir(), key=lambda entry: entry.name)
        if entry.name.endswith(".toml")
    }


def read_drafts(
    sources: Sequence[str], births: int | None = None, run: str | None = None
) -> list[tuple[str, Draft]]:
    """Return names and documents; a campaign stands for its experiments.

    Sources are names of shipped experiments or campaigns, or paths to .toml files;
    births and run are those of ``--births`` and ``--from``, as of ``read_draft``.

    Raises:
        ExperimentError: there is no such experiment, or its document is invalid.
    """
    shipped = shipped_campaigns()
    for source in sources:
        check_source(source, [*shipped_experiments(), *shipped])
    words = [word for source in sources for word in shipped.get(source, (source,))]
    return [(word, read_draft(word, births, run=run)) for word in words]


def checked_experiments(
    drafts: Sequence[tuple[str, Draft]],
    check: Callable[[Experiment], None] = lambda _experiment: None,
) -> tuple[Experiment, ...]:
    """Return the experiments of ``read_drafts`` that can be runs of one campaign.

    ``check`` may refuse one by an ``ExperimentError``.

    Raises:
        ExperimentError: a document is inconsistent or refused, or two experiments have
            the same name.
    """
    experiments: list[Experiment] = []
    for word, draft in drafts:
        own = draft.checked()
        with naming(word):
            _check_folders(own)
            for experiment in own:
                check(experiment)
        experiments += own
    _check_distinct(experiments)
    return tuple(experiments)


def joined_name(experiments: Sequence[Experiment]) -> str:
    """Return the names of experiments, joined by "+", for that of their folder.

    A sweep counts once, with the name of its document. Of names that are too long
    together the last ones are only counted.
    """
    names = list(
        dict.fromkeys(
            each.name.rpartition("-")[0] if each.sweep is not None else each.name
            for each in experiments
        )
    )
    most = len(names)
    while most > 1 and len("+".join(names[:most])) > _LONGEST_NAME:
        most -= 1
    rest = [f"{len(names) - most}-more"] if most < len(names) else []
    return "+".join([*names[:most], *rest])


def _check_folders(experiments: Sequence[Experiment]) -> None:
    for name in (experiment.name for experiment in experiments):
        if "/" in name or name.startswith("."):
            raise ExperimentError(
                f"name: must have no '/' and not start with '.', as a folder is named "
                f"after it, got {name!r}"
            )


def _check_distinct(experiments: Sequence[Experiment]) -> None:
    """Raise unless names differ."""
    names = [experiment.name for experiment in experiments]
    for name in names:
        if names.count(name) > 1:
            raise ExperimentError(
                f"name: the experiments of a campaign must have different names, but "
                f"{names.count(name)} are called {name!r}"
            )


def refuse_used(folder: Path, wanted: Campaign) -> None:
    """Raise ``RunFolderError`` if a folder already holds a campaign or a single run.

    The message says if only its number of births is another than the wanted one.
    """
    if is_campaign(folder):
        which, flags = _difference(folder, wanted)
        raise RunFolderError(
            f"{folder}: already holds {which}; to resume it: "
            f"{resume_command(folder, *flags)}; or choose another folder"
        )
    if holds_run(folder):
        raise RunFolderError(
            f"{folder}: already holds a run; choose another folder for a campaign"
        )


def _difference(folder: Path, wanted: Campaign) -> tuple[str, tuple[str, ...]]:
    """Return which campaign a folder holds, and flags to make it the wanted one."""
    births = min(each.births for each in wanted.experiments)
    with suppress(RunFolderError):
        held = read_campaign(folder)
        longer = tuple(replace(each, births=births) for each in held.experiments)
        if held != wanted and dataclasses.replace(held, experiments=longer) == wanted:
            theirs = " or ".join({str(each.births): 0 for each in held.experiments})
            return f"this campaign with {theirs} births", ("--births", str(births))
    return "a campaign", ()


def write_campaign(folder: Path, campaign: Campaign) -> None:
    """Write the description of a campaign to its folder."""
    # JSON with all defaults; without a single quote it cannot end the literal.
    documents = [
        experiment_text(experiment).replace("'", "\\u0027")
        for experiment in campaign.experiments
    ]
    plugins: dict[str, KeptPlugin] = {}
    for document in documents:
        plugins |= keep(folder, document, replace_bytes)
    content = _Document(
        campaign.seed,
        campaign.repeats,
        list(map(_Entry, documents)),
        plugins=plugins,
        first=campaign.first,
        founders=campaign.founders,
    )
    lines = [
        f"# To resume it:  {printable_line(command('resume', folder))}",
        f'digest = "{_digest(content)}"',
        f"seed = {campaign.seed}",
        f"repeats = {campaign.repeats}",
    ]
    if campaign.first:
        lines.append(f"first = {campaign.first}")
    tables: dict[str, KeptPlugin | KeptFounder] = {
        **{f"plugins.{name}": note for name, note in plugins.items()},
        **{f"founders.{key}": kept for key, kept in campaign.founders.items()},
    }
    for name, table in tables.items():
        lines += ["", f"[{name}]"]
        # A text of JSON without other characters is one of TOML.
        entries = msgspec.to_builtins(table).items()
        lines += [f"{key} = {json.dumps(value)}" for key, value in entries]
    for document in documents:
        lines += ["", "[[experiments]]", f"document = '''\n{document}'''"]
    replace_text(folder / CAMPAIGN, "\n".join(lines) + "\n")


def read_campaign(folder: Path) -> Campaign:
    """Return the campaign of a folder.

    Raises:
        RunFolderError: there is no campaign, or its description is damaged.
    """
    found = _read(folder)
    documents = [each.document for each in found.experiments]
    try:
        experiments = tuple(map(experiment_from_text, documents))
        _check_folders(experiments)
        _check_distinct(experiments)
    except ExperimentError as error:
        raise _damaged(folder, str(error)) from None
    return Campaign(experiments, found.repeats, found.seed, found.first, found.founders)


def campaign_plugins(folder: Path) -> dict[str, KeptPlugin]:
    """Return the plug-in modules of a folder's campaign, as ``read_campaign``."""
    return _read(folder).plugins


def _read(folder: Path) -> "_Document":
    try:
        text = read_small(folder / CAMPAIGN, MOST_DESCRIPTION).decode("utf-8")
        found = msgspec.convert(tomllib.loads(text), type=_Document)
    except FileNotFoundError:
        raise RunFolderError(f"{folder}: no campaign is there") from None
    except (ValueError, RecursionError, msgspec.MsgspecError) as error:
        raise _damaged(folder, str(error)) from None
    if found.seed >> 64:
        raise RunFolderError(
            f"{folder / CAMPAIGN}: damaged: seed must be < 2^64, got {found.seed}"
        )
    if found.digest not in ("", _digest(found)):
        raise _damaged(folder, "its digest is not that of its content")
    return found


def _damaged(folder: Path, why: str) -> RunFolderError:
    return RunFolderError(
        f"{folder / CAMPAIGN}: damaged: {printable(why, 200)}; restore a copy of the "
        "file"
    )


class _Entry(msgspec.Struct, forbid_unknown_fields=True):
    document: str


class _Document(msgspec.Struct, forbid_unknown_fields=True):
    """Content of ``campaign.toml``; that of older versions has no digest."""

    seed: Annotated[int, msgspec.Meta(ge=0)]
    repeats: Annotated[int, msgspec.Meta(ge=1, le=MOST_REPEATS)]
    experiments: Annotated[list[_Entry], msgspec.Meta(min_length=1)]
    digest: str = ""
    plugins: dict[str, KeptPlugin] = {}
    first: Annotated[int, msgspec.Meta(ge=0, le=MOST_REPEATS)] = 0
    founders: dict[str, KeptFounder] = {}


def _digest(found: _Document) -> str:
    """Return the SHA-256 of a campaign, without a first repeat of 0, as of old ones."""
    numbers = (found.seed, found.repeats, *([found.first] if found.first else ()))
    parts = [*map(str, numbers), *(each.document for each in found.experiments)]
    for name, note in sorted(found.plugins.items()):
        parts += [name, *msgspec.structs.astuple(note)]
    for key, kept in sorted(found.founders.items()):
        parts += [key, kept.genome.hex(), kept.run, kept.file]
    return sha256("\n".join(parts).encode()).hexdigest()


def forget_campaign(folder: Path) -> None:
    """Remove the description of a campaign from its folder."""
    forget_plugins(folder, campaign_plugins(folder))
    (folder / CAMPAIGN).unlink(missing_ok=True)


def check_adopted(folder: Path, found: RunDetails, wanted: RunDetails) -> None:
    """Raise ``RunFolderError`` unless a folder holds the run that a campaign expects.

    The run may only have a different number of births.
    """
    ours = experiment_from_text(wanted.document)
    theirs = experiment_from_text(found.document)
    same = replace(theirs, births=ours.births)
    if (found.name, found.run, found.seed, same) == (
        wanted.name, wanted.run, wanted.seed, ours,
    ):  # fmt: skip
        return
    what = "another experiment of that name"
    if (found.run, found.seed) != (wanted.run, wanted.seed):
        what = f"run {found.run} of seed {found.seed}"
    raise RunFolderError(
        f"{folder}: must be run {wanted.run} of seed {wanted.seed} of "
        f"{wanted.name}, but holds {what}: choose another folder"
    )
