"""Given founders of experiments, read from robot files and runs before a run starts."""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from hashlib import sha256
from itertools import islice
from pathlib import Path

import pyarrow.compute as pc
from msgspec import json
from msgspec.structs import replace

from coordinator.evolution.encodings import IslandEncoding, encoding_of, outside_limits
from schema.errors import (
    ExperimentError,
    InvalidRobot,
    MalformedMessage,
    check_most,
    naming,
)
from schema.experiment.brains import types_of
from schema.experiment.document import (
    UNNAMED,
    Experiment,
    FounderGenome,
    Founders,
    Vetting,
    island_experiments,
)
from schema.experiment.file import experiment_from_text
from schema.formats.files import read_robot
from schema.formats.yaml_reader import OTHER_TYPES
from schema.limits import MOST_FOUNDER_BYTES
from schema.parts import BodySpace
from schema.plugins.source import digest_in_use, modules_named
from schema.robot.ids import BirthId
from schema.robot.results import Report
from schema.robot.robot import Robot
from schema.tables.columns import Row
from schema.tables.description import KeptFounder, read_description, run_columns
from schema.tables.files import read_table
from schema.tables.last_populations import (
    archive_at,
    best_ever,
    fittest,
    last_populations,
)
from schema.wire.protobuf import decode_robot
from schema.wire.updates import individual

Kept = dict[str, KeptFounder]
Vet = Callable[[Robot, BodySpace, Vetting], Report]
Check = Callable[[Robot], str]
"""Returns what is wrong with a robot that a genome describes here, or nothing."""
Read = Iterator[tuple[str, BirthId | None, KeptFounder, Check]]
"""For each founder where it is, its birth in a run, and what the run folder holds."""


def with_founders(
    experiments: Iterable[Experiment], vet: Vet
) -> tuple[tuple[Experiment, ...], Kept]:
    """Return experiments that name founders by their content, and these by digest.

    Raises:
        RevolveError: a file, a run or a birth that is missing or damaged; a robot that
            does not fit the experiment, its encoding or its analyzer.
    """
    kept: Kept = {}
    named = []
    for each in experiments:
        with naming(each.name):
            read = partial(_named, experiment=each, vet=vet, kept=kept)
            islands = tuple(
                replace(own, founders=read(own.founders)) for own in each.islands
            )
            named.append(replace(each, founders=read(each.founders), islands=islands))
    size = sum(len(founder.genome) for founder in kept.values())
    check_most(size, MOST_FOUNDER_BYTES, "bytes", "founders", ExperimentError)
    return tuple(named), kept


def _named(
    given: Founders | None, experiment: Experiment, vet: Vet, kept: Kept
) -> Founders | None:
    """Return a section that names founders by their content; keep these by digest."""
    if given is None:
        return None
    if given.genomes:
        raise ExperimentError(
            "founders.genomes: are kept in the folder of the run that had them: name "
            "it with founders.run, and births with founders.population"
        )
    # Encoding, part types and vetting are those of all islands.
    encoding = encoding_of(island_experiments(experiment)[0])
    source = _of_files if given.run is None else _of_run
    genomes = []
    for where, birth, founder, check in source(given, experiment, encoding):
        try:
            robot = encoding.develop(encoding.from_bytes(founder.genome))
            encoding.check(robot)
            why = (
                outside_limits(robot, experiment.space, encoding.types)
                or check(robot)
                or vet(robot, encoding.types, experiment.vetting).reason
            )
        except InvalidRobot as error:
            why = str(error)
        if why:
            raise ExperimentError(f"founders: {where}: {why}")
        digest = sha256(founder.genome).hexdigest()
        kept.setdefault(digest, founder)
        born = {"island": birth.island, "birth": birth.number} if birth else {}
        genomes.append(FounderGenome(digest=digest, **born))
    return Founders(repeat=given.repeat, genomes=tuple(genomes))


def _of_files(
    given: Founders, experiment: Experiment, encoding: IslandEncoding
) -> Read:
    for number, file in enumerate(given.files):
        name = "" if file.endswith(UNNAMED) else file
        where = name or f"robot {number}"
        try:
            robot = read_robot(Path(file), *types_of(experiment))
            genome = encoding.to_bytes(encoding.from_robot(robot))
        except (InvalidRobot, MalformedMessage) as error:
            why = str(error).removeprefix(f"{file}: ").replace(OTHER_TYPES, "")
            raise ExperimentError(f"founders: {where}: {why}") from error
        yield where, None, KeptFounder(genome, file=name), lambda _: ""


def _of_run(given: Founders, experiment: Experiment, encoding: IslandEncoding) -> Read:
    folder = Path(given.run or "")
    known = read_description(folder)
    theirs = experiment_from_text(known.document)
    if theirs.encoding != experiment.encoding:
        other = f"{theirs.encoding.type!r}, {theirs.encoding.parameters}"
        what = "another encoding than the experiment, or other parameters of it"
        raise ExperimentError(f"founders.run: {folder}: has {what}: {other}")
    for name in modules_named(json.encode(experiment.space.part_types)):
        note = known.plugins.get(name)
        if note is not None and note.digest != digest_in_use(name):
            what = f"has part types of plug-in {name} with another source"
            how = "restore it, or give robot files of the run as founders.files"
            raise ExperimentError(f"founders.run: {folder}: {what}: {how}")
    run_id = str(run_columns(folder)["run_id"])
    paths = zip(encoding.types, experiment.space.part_types, strict=True)
    others = {kind: p for kind, p in paths if p not in theirs.space.part_types}
    most = max(each.selection.population for each in island_experiments(experiment))
    for birth, row in _births(folder, given, most):
        check = partial(_difference, stored=row["robot"], others=others)
        founder = KeptFounder(row["genome"], run=run_id)
        yield f"{folder}: birth {birth.name}", birth, founder, check


def _difference(robot: Robot, stored: bytes | None, others: dict[str, str]) -> str:
    """Return in what a robot differs from the one that was born, or nothing.

    ``others``: paths of part types that its run did not have, by name.
    """
    for kind in sorted(others.keys() & {part.kind for part in robot.parts}):
        return f"{kind} is {others[kind]} here, another part type there"
    if stored and decode_robot(stored).parts != robot.parts:
        return "its genome develops into another body here"
    return ""


def _births(folder: Path, given: Founders, most: int) -> Iterator[tuple[BirthId, Row]]:
    if isinstance(given.population, str):
        rows = best_ever(folder)
        if given.population == "last":
            rows = iter(fittest(last_populations(folder)))
        elif given.population == "archive":
            rows = iter(fittest(archive_at(folder)))
        own = (row for row in rows if given.island in (None, row["island"]))
        # Copies of a migrant count once.
        births = list(islice(dict.fromkeys(map(individual, own)), most))
    else:
        births = [BirthId(given.island or 0, number) for number in given.population]
    if not births:
        place = "" if given.island is None else f" on island {given.island}"
        raise ExperimentError(f"founders.run: {folder}: no robot has a fitness{place}")
    is_wanted = pc.field("birth").isin([birth.number for birth in births])
    columns = ["island", "birth", "genome", "robot"]
    stored = read_table(folder, "births", columns, is_wanted).to_pylist()
    by_birth = {individual(row): row for row in stored}
    for birth in births:
        if birth not in by_birth:
            why = f"has no birth {birth.number} on island {birth.island}"
            raise ExperimentError(f"founders.population: {folder}: {why}")
        yield birth, by_birth[birth]
