"""What operators want of a run's arenas: checked, journalled, carried out.

An order takes effect at the arena's next decision and stands in the journal with
that step before the operator is told, so that a replay obeys it, too.
"""

from coordinator.arena.arena import Arena
from coordinator.arena.orders import check_order
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
from schema.experiment.document import Experiment, body_space, island_experiment
from schema.robot.ids import BirthId
from schema.robot.inverse_development import genome_of
from schema.robot.robot import check_robot
from schema.wire.operator import (
    BrainWish,
    InsertWish,
    ListWish,
    OperatorReply,
    PauseWish,
    RemoveWish,
    ResumeWish,
    SnapshotWish,
    StatusWish,
    decode_operator_request,
    encode_operator_reply,
)


class Refused(RevolveError):  # noqa: N818 - reads as what it says
    """A wish that cannot be granted: the operator is told why."""


class Desk:
    """Where operators of one run are served."""

    def __init__(self, loop: Loop, experiment: Experiment) -> None:
        """Serve the arenas of a loop that has started."""
        self._loop = loop
        self._experiment = experiment

    def answer(self, data: bytes) -> bytes:
        """Return the encoded reply to an encoded request.

        On return the journal has what was ordered. Whatever is wrong with the
        request is told to the operator and changes nothing.

        Raises:
            RunFolderError: the disk is full or failed.
        """
        try:
            request = decode_operator_request(data)
            arena = self._arena(request.island)
            wish = request.wish
            assert not isinstance(wish, StatusWish)  # the reception's
            if isinstance(wish, ListWish):
                text = self._list(arena, request.island)
            elif isinstance(wish, SnapshotWish):
                self._loop.shard_requests.wish_snapshot(request.island)
                text = "the state is kept at the end of the next advance"
            else:
                order = self._order(wish, arena)
                event = Commanded(
                    request.island, request.request_id, arena.next_step, order
                )
                text = self._effect(event)
        except RevolveError as error:
            return encode_operator_reply(OperatorReply(str(error), is_refused=True))
        if not isinstance(wish, ListWish | SnapshotWish):
            self._loop.order(event)
        return encode_operator_reply(OperatorReply(text))

    def _arena(self, number: int) -> Arena:
        arena = self._loop.islands.get(number)
        if not isinstance(arena, Arena):
            raise Refused(f"island {number}: no arena of this run")
        if arena.is_finished:
            raise Refused(f"arena {number}: has finished")
        return arena

    def _order(
        self,
        wish: PauseWish | ResumeWish | InsertWish | RemoveWish | BrainWish,
        arena: Arena,
    ) -> Order:
        """Return the order that a wish comes to.

        Raises:
            Refused: nobody of that name lives there.
            InvalidRobot: a robot that breaks the rules of the experiment.
        """
        space = body_space(self._experiment.space)
        order: Order
        match wish:
            case PauseWish():
                order = Pause()
            case ResumeWish():
                order = Resume()
            case InsertWish():
                check_robot(wish.robot, space)
                order = Insert(genome_of(wish.robot), wish.place)
            case RemoveWish():
                _check_lives(wish.birth, arena)
                order = Remove(wish.birth)
            case BrainWish():
                _check_lives(wish.birth, arena)
                order = ReplaceBrain(wish.birth, wish.robot.brain)
        check_order(order, self._experiment)
        return order

    def _effect(self, event: Commanded) -> str:
        step_s = self._own(event.island).simulation.timestep_s
        return f"takes effect at {event.step * step_s:g} s"

    def _own(self, island: int) -> Experiment:
        return island_experiment(self._experiment, island)

    def _list(self, arena: Arena, island: int) -> str:
        """Return a line on the arena and one on each of the living."""
        state = "paused" if arena.is_paused else "running"
        own = self._own(island)
        now_s, births = arena.step * own.simulation.timestep_s, own.births
        about = f"{arena.births} of {births} born, {len(arena.population)} alive"
        lines = [f"{state} at {now_s:g} s, {about}", "birth  rank  fitness"]
        lines += [
            f"{one.birth.number:5}  {one.rank:4}  {one.fitness:7.4f}"
            for one in arena.population
        ]
        return "\n".join(lines)


def _check_lives(birth: BirthId, arena: Arena) -> None:
    living = [one.birth for one in arena.population]
    if birth not in living:
        numbers = ", ".join(str(each.number) for each in living) or "nobody"
        raise Refused(f"birth {birth.number}: does not live; alive are {numbers}")


class Reception:
    """Tells how far all runs are; leads operators to the desk of theirs."""

    def __init__(self, scheduler: RunScheduler) -> None:
        """Receive for all runs of a process."""
        self._scheduler = scheduler

    def answer(self, data: bytes, now_s: float) -> bytes:
        """Return the encoded reply to an encoded request.

        Args:
            data: of an ``OperatorRequest``.
            now_s: the time, of any clock that only goes forward [s].
        """
        try:
            request = decode_operator_request(data)
            if isinstance(request.wish, StatusWish):
                status = self._scheduler.status(now_s)
                return encode_operator_reply(OperatorReply("", status=status))
            run = self._run(request.run)
        except (MalformedMessage, Refused) as error:
            return encode_operator_reply(OperatorReply(str(error), is_refused=True))
        replies: list[bytes] = []
        desk = Desk(run.loop, run.experiment)
        self._scheduler.guard(run, lambda: replies.append(desk.answer(data)))
        if replies:
            return replies[0]
        failed = OperatorReply("the run cannot go on", is_refused=True)
        return encode_operator_reply(failed)

    def _run(self, name: str) -> RunSession:
        """Return whose operator asks.

        Raises:
            Refused: not exactly one run is meant.
        """
        runs = [
            run
            for run in self._scheduler.active
            if run.held.path.name.endswith(name)
            and any(isinstance(each, Arena) for each in run.loop.islands.values())
        ]
        if len(runs) == 1:
            return runs[0]
        names = ", ".join(sorted(run.held.path.name for run in runs)) or "none"
        raise Refused(f"one run with an arena must be meant; running are {names}")
