"""Several experiments, each repeated, as one undertaking in one folder.

``campaign.toml`` in it says all that its runs are a function of, so that the folder
alone is enough to go on. Each run has an ordinary run folder below it, named after
experiment and repeat; one that was made by itself is as good as one made here.
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from coordinator.storage.disk import replace_durably
from coordinator.storage.folder import RunDetails, holds_run
from coordinator.storage.hints import command
from schema.errors import ExperimentError, RunFolderError
from schema.experiment.document import Experiment
from schema.experiment.file import (
    check_source,
    experiment_from_text,
    experiment_text,
    read_experiment,
    shipped_experiments,
)

CAMPAIGN = "campaign.toml"


@dataclass(frozen=True, slots=True)
class Campaign:
    """What is run, how often, and from which seed.

    Attributes:
        experiments: in the order in which they are begun, names differing.
        repeats: of each; run numbers are 0 to ``repeats - 1``.
        seed: of all runs; their numbers tell their streams apart.
    """

    experiments: tuple[Experiment, ...]
    repeats: int
    seed: int

    def runs(self, folder: Path) -> list[tuple[Path, RunDetails]]:
        """Return folder and details of each run, all first repeats first."""
        return [
            (
                folder / f"{experiment.name}-{repeat}",
                RunDetails(
                    experiment.name, repeat, self.seed, experiment_text(experiment)
                ),
            )
            for repeat in range(self.repeats)
            for experiment in self.experiments
        ]


def is_campaign(folder: Path) -> bool:
    """Return whether a folder is one of a campaign."""
    return (folder / CAMPAIGN).exists()


def shipped_campaigns() -> dict[str, tuple[str, ...]]:
    """Return the experiments of each campaign that comes with the package."""
    folder = resources.files("coordinator") / "campaigns"
    return {
        entry.name.removesuffix(".toml"): tuple(
            tomllib.loads(entry.read_text(encoding="utf-8"))["experiments"]
        )
        for entry in sorted(folder.iterdir(), key=lambda entry: entry.name)
        if entry.name.endswith(".toml")
    }


def read_experiments(sources: Sequence[str]) -> tuple[Experiment, ...]:
    """Return the experiments that words name; a campaign's name stands for all of it.

    Args:
        sources: names of shipped experiments or campaigns, or paths to .toml files.

    Raises:
        ExperimentError: no such experiment, a document that is not one, or two
            experiments of one name.
    """
    shipped = shipped_campaigns()
    for source in sources:
        check_source(source, [*shipped_experiments(), *shipped])
    words = [word for source in sources for word in shipped.get(source, (source,))]
    experiments = tuple(map(read_experiment, words))
    names = [experiment.name for experiment in experiments]
    for name in names:
        if names.count(name) > 1:
            raise ExperimentError(
                f"name: the experiments of a campaign need names of their own, and "
                f"{names.count(name)} of these are called {name!r}"
            )
        if "/" in name or name.startswith("."):
            raise ExperimentError(
                f"name: a campaign's folder cannot hold one called {name!r}"
            )
    return experiments


def refuse_used(folder: Path) -> None:
    """Raise if a folder holds a campaign already, or a single run.

    Raises:
        RunFolderError: it does.
    """
    if is_campaign(folder):
        raise RunFolderError(
            f"{folder}: already holds a campaign; to go on with it: "
            f"{command('resume', folder)}; or choose another folder"
        )
    if holds_run(folder):
        raise RunFolderError(
            f"{folder}: already holds a run; choose another folder for a campaign"
        )


def write_campaign(folder: Path, campaign: Campaign) -> None:
    """Write down what is run in a folder.

    Raises:
        RunFolderError: the disk is full or failed.
    """
    lines = [
        f"# Go on with it:  {command('resume', folder)}",
        f"seed = {campaign.seed}",
        f"repeats = {campaign.repeats}",
    ]
    for experiment in campaign.experiments:
        # JSON with every default: no line of it can end a TOML literal string.
        document = experiment_text(experiment).replace("'", "\\u0027")
        lines += ["", "[[experiments]]", f"document = '''\n{document}'''"]
    text = "\n".join(lines) + "\n"
    replace_durably(
        folder / CAMPAIGN, lambda file: file.write_text(text, encoding="utf-8")
    )


def read_campaign(folder: Path) -> Campaign:
    """Return what is run in a folder.

    Raises:
        RunFolderError: no campaign is there, or its description is damaged.
    """
    file = folder / CAMPAIGN
    try:
        document: dict[str, Any] = tomllib.loads(file.read_text(encoding="utf-8"))
        return Campaign(
            tuple(
                experiment_from_text(each["document"])
                for each in document["experiments"]
            ),
            int(document["repeats"]),
            int(document["seed"]),
        )
    except (OSError, ValueError, KeyError, TypeError, ExperimentError) as error:
        raise RunFolderError(f"{file}: is not one of a campaign: {error}") from None


def forget_campaign(folder: Path) -> None:
    """Let a folder be one of no campaign again."""
    (folder / CAMPAIGN).unlink(missing_ok=True)


def check_adopted(folder: Path, found: RunDetails, wanted: RunDetails) -> None:
    """Raise unless the run that a folder holds is the one that is wanted.

    A number of births of its own is all in which it may differ.

    Args:
        folder: of the run, to name it.
        found: what it holds.
        wanted: what it shall hold.

    Raises:
        RunFolderError: another run is there.
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
        f"{wanted.name}, and holds {what}: choose another folder"
    )
