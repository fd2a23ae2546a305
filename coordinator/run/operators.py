"""Operator requests: checked, journalled, carried out.

An order takes effect at the arena's next decision. The journal holds the order with
that step before the operator gets a reply, so that a replay carries it out too.
"""

import math
import time
from pathlib import Path

from msgspec.structs import replace

from coordinator.arena.arena import Arena
from coordinator.arena.living import LivingRobot
from coordinator.arena.orders import check_order
from coordinator.evolution.encodings import outside_limits
from coordinator.islands.events import (
    Commanded,
    Insert,
    Order,
    Pause,
    Remove,
    ReplaceBrain,
    Resume,
)
from coordinator.run.loop import Loop
from coordinator.run.scheduler import RunScheduler
from coordinator.run.session import RunSession
from schema.errors import MalformedMessage, RevolveError
from schema.experiment.document import Experiment
from schema.limits import LONGEST_REASON, OPERATOR_REQUEST_BYTES, printable
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.codec import decode, encode
from schema.wire.operator import (
    ArenaListing,
    GetStatus,
    InsertRobot,
    ListedRobot,
    ListRobots,
    OperatorReply,
    OperatorRequest,
    PauseArena,
    RemoveRobot,
    ResumeArena,
    SaveSnapshot,
    SetBrain,
    birth_name,
    selected_names,
)

FARTHEST_PLACE_M = 1e6
"""Distance from the centre at which no robot is inserted [m].

Much farther away, a robot's motion is smaller than the precision of its position.
"""


class Refused(RevolveError):  # noqa: N818 - reads as what it says
    """A request that cannot be carried out; the reply says why."""


def reply_to(request: OperatorRequest, loop: Loop) -> OperatorReply:
    """Carry out a request to a run and return the reply.

    On return the journal holds the order. A faulty request is refused and changes
    nothing.

    ``request``: for an arena of the run; ``answer_operator`` replies to ``GetStatus``.

    Raises:
        RunFolderError: the disk is full or failed.
    """
    island, action = request.island, request.action
    assert not isinstance(action, GetStatus)
    try:
        arena = _arena(loop, island)
        if isinstance(action, ListRobots):
            return OperatorReply("", arena=_listing(arena))
        if isinstance(action, SaveSnapshot):
            loop.shard_requests.request_snapshot(island)
            return OperatorReply("the state is saved at the end of the next advance")
        step, order = arena.next_step, _order(action, arena, island)
    except RevolveError as error:
        return OperatorReply(str(error), is_refused=True)
    loop.order(Commanded(island, request.request_id, step, order))
    effect_s = arena.clock.seconds(step)
    return OperatorReply(f"takes effect at {effect_s:g} s", effect_s=effect_s)


def _arena(loop: Loop, number: int) -> Arena:
    arena = loop.islands.get(number)
    if not isinstance(arena, Arena):
        arenas = [i for i, own in loop.islands.items() if isinstance(own, Arena)]
        raise Refused(f"island {number}: no arena of this run; arenas are {arenas}")
    if arena.is_finished:
        raise Refused(f"arena {number}: has finished")
    return arena


def _order(
    action: PauseArena | ResumeArena | InsertRobot | RemoveRobot | SetBrain,
    arena: Arena,
    island: int,
) -> Order:
    """Return the order of an action in the arena of an island.

    Raises:
        Refused: no living robot has the given birth number, a robot outside the limits
            of ``[space]``, or a place too far away.
        InvalidRobot: a robot that breaks the rules of the experiment, or that its
            encoding cannot describe.
    """
    match action:
        case PauseArena():
            return Pause()
        case ResumeArena():
            return Resume()
        case InsertRobot():
            _check_place(action.place, arena.experiment)
            robot = action.robot
            encoding = arena.encoding
            _check_robot(robot, arena)
            genome = encoding.to_bytes(encoding.from_robot(robot))
            parents = [_living(birth, arena, island) for birth in action.parents]
            rank = 1 + max((parent.individual.rank for parent in parents), default=0)
            insert = Insert(genome, action.place, action.parents, rank)
            check_order(insert, arena.experiment)
            return insert
    living = _living(action.birth, arena, island)
    if isinstance(action, RemoveRobot):
        return Remove(action.birth)
    brain = action.robot.brain
    _check_robot(replace(living.robot, brain=brain), arena)
    return ReplaceBrain(action.birth, brain)


def _living(birth: BirthId, arena: Arena, island: int) -> LivingRobot:
    """Return a living robot of an arena; ``Refused`` if it is not alive."""
    living = arena.living.get(birth)
    if living is None:
        alive = [birth_name(one.birth, island) for one in arena.living]
        raise Refused(
            f"birth {birth_name(birth, island)}: is not alive; alive are "
            f"{', '.join(alive) or 'none'}"
        )
    return living


def _check_robot(robot: Robot, arena: Arena) -> None:
    """Raise unless a robot may live in an arena.

    Orders in the journal are not checked for the limits of ``[space]``: earlier
    versions accepted them.
    """
    encoding = arena.encoding
    encoding.check(robot)
    if problem := outside_limits(robot, arena.experiment.space, encoding.types):
        raise Refused(f"robot: {problem}")


def _check_place(place: tuple[float, float] | None, experiment: Experiment) -> None:
    """Raise unless a place is inside the wall of an arena, or near if it has none."""
    assert experiment.arena is not None
    radius_m = experiment.arena.wall_diameter_m / 2.0
    limit_m = min(radius_m or math.inf, FARTHEST_PLACE_M)
    if place is not None and math.hypot(*place) >= limit_m:
        within = "inside the wall, " if limit_m == radius_m else ""
        raise Refused(
            f"place: must be {within}< {limit_m:g} m from the centre, got "
            f"{place[0]:g} {place[1]:g}"
        )


def _listing(arena: Arena) -> ArenaListing:
    return ArenaListing(
        arena.clock.seconds(arena.step),
        arena.is_paused,
        arena.births,
        arena.experiment.births,
        tuple(
            ListedRobot(
                each.birth,
                each.individual.rank,
                each.individual.parents,
                each.position[:2],
                each.judgement.age_s if each.judgement else 0.0,
                each.known_fitness,
            )
            for each in arena.living
        ),
    )


def answer_operator(scheduler: RunScheduler, data: bytes, now_s: float) -> bytes:
    """Return the encoded reply to an operator's encoded request."""
    try:
        request = decode(OperatorRequest, data, OPERATOR_REQUEST_BYTES)
        if isinstance(request.action, GetStatus):
            status = scheduler.status(now_s)
            reply = OperatorReply("", status=status, time_s=time.time())
        else:
            reply = _carry_out(request, scheduler)
    except MalformedMessage as error:
        scheduler.fleet.faults.note("malformed", "operators", str(error))
        reply = OperatorReply(printable(str(error), LONGEST_REASON), is_refused=True)
    except Refused as error:
        reply = OperatorReply(str(error), is_refused=True)
    return encode(reply)


def _carry_out(request: OperatorRequest, scheduler: RunScheduler) -> OperatorReply:
    """Return the reply of a run; a run that fails here is stopped."""
    run = _run(request.run, scheduler)
    if run.recovery is not None:
        done, total = run.recovery.progress
        raise Refused(
            f"lost poses are computed again (advance {done} of {total}): try again "
            "when that is done"
        )
    replies: list[OperatorReply] = []
    scheduler.guard(run, lambda: replies.append(reply_to(request, run.loop)))
    if not replies:
        raise Refused("the run cannot go on")
    return replies[0]


def _run(name: str, scheduler: RunScheduler) -> RunSession:
    """Return the run that a name selects among all runs, finished ones included.

    Raises:
        Refused: no running run with an arena has such a name, or several have.
    """
    active = scheduler.active
    planned = [Path(each.status.folder).name for each in scheduler.planned]
    selected = selected_names(name, [*planned, *map(_name, active)])
    runs = [
        run
        for run in active
        if _name(run) in selected
        and any(isinstance(each, Arena) for each in run.loop.islands.values())
    ]
    if len(runs) == 1:
        return runs[0]
    names = ", ".join(sorted(map(_name, runs))) or "none"
    raise Refused(
        f"the name must match one running run with an arena; matching: {names}"
    )


def _name(run: RunSession) -> str:
    """Return the name of a run's folder, as its status has it: without links."""
    return run.held.path.resolve().name
