"""Check of what another coordinator says that its islands have sent.

Migrants that pass are such as the experiment may have. A plausible lie, such as another
fitness, is not found.
"""

from collections import Counter
from collections.abc import Mapping

from coordinator.evolution.breeding import Individual
from coordinator.evolution.encodings import IslandEncoding, encoding_of, outside_limits
from coordinator.islands.events import Immigrated, MigrationEvent, source_of
from coordinator.islands.migration import Neighbours
from schema.errors import ExperimentError, InvalidRobot, MalformedMessage
from schema.experiment.document import Experiment
from schema.experiment.migration import migrant_count
from schema.limits import MOST_NUMBER
from schema.robot.ids import BirthId
from schema.wire.migration import Needed


def check_arrival(
    event: MigrationEvent,
    needed: Needed,
    links: Neighbours,
    islands: Mapping[int, Experiment],
) -> None:
    """Raise unless an event can be what an island needs.

    ``links``: of the receiving island. ``islands``: settings of all islands.

    Raises:
        MalformedMessage: of other islands, another epoch, too many migrants, or one
            that the experiment does not allow.
    """
    about = (source_of(event), event.island)
    if about != (needed.source, needed.target):
        raise _false(needed, f"got something of island {about[0]} for {about[1]}")
    if not isinstance(event, Immigrated):
        return
    if event.epoch != needed.epoch:
        raise _false(needed, f"got those of epoch {event.epoch}")
    most = _most(islands[event.source]) if event.source in links.sources else 0
    if most is not None and len(event.migrants) > most:
        raise _false(needed, f"must be <= {most}, got {len(event.migrants)}")
    for birth, times in Counter(one.birth for one in event.migrants).items():
        if times > 1:
            raise _false(needed, f"migrant {birth.name} is there {times} times")
    for one in event.migrants:
        try:
            _check_migrant(one, islands, encoding_of(islands[event.source]))
        except (InvalidRobot, ExperimentError) as error:  # of own code, too
            why = f"migrant {one.birth.name}: {error}"
            raise _false(needed, why) from None


def _most(source: Experiment) -> int | None:
    """Return how many migrants an island sends at most; None: its rules decide."""
    assert source.migration is not None
    migrants, culling = source.migration.migrants, source.selection.culling
    if isinstance(migrants, int) or source.arena is not None:
        return migrants if isinstance(migrants, int) else None
    living = max(
        source.selection.population, culling.population_limit if culling else 0
    )
    return migrant_count(source.migration, living)


def _check_migrant(
    one: Individual, islands: Mapping[int, Experiment], encoding: IslandEncoding
) -> None:
    """Raise ``InvalidRobot`` unless a migrant can be one of the experiment."""
    for name, birth in [("birth", one.birth), *(("parent", p) for p in one.parents)]:
        if not _is_birth(birth, islands):
            raise InvalidRobot(f"{name} {birth.name} is none of the experiment")
    own = islands[one.birth.island]
    robots = [encoding.robot_of(one.genome)]
    if own.learning is not None and one.learnt is not None:
        robots.append(one.learnt)
    elif one.learnt is not None:
        raise InvalidRobot("robots of its island do not learn")
    for robot in robots:
        encoding.check(robot)
        if problem := outside_limits(robot, own.space, encoding.types):
            raise InvalidRobot(problem)
        if len(robot.parts) != one.size:
            raise InvalidRobot(f"must have {one.size} parts, got {len(robot.parts)}")
    if not one.measures.keys() <= set(own.measures.labels):
        raise InvalidRobot("it has measures that the experiment does not name")


def _is_birth(birth: BirthId, islands: Mapping[int, Experiment]) -> bool:
    """Return whether a birth can be one of the experiment; orders add some."""
    own = islands.get(birth.island)
    return own is not None and birth.number < (MOST_NUMBER if own.arena else own.births)


def _false(needed: Needed, why: str) -> MalformedMessage:
    return MalformedMessage(
        f"migrants of epoch {needed.epoch} from island {needed.source} to "
        f"{needed.target}: {why}"
    )
