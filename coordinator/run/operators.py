"""Operator requests: checked, journalled, carried out.

An order takes effect at the arena's next decision. The journal holds the order with
that step before the operator gets a reply, so that a replay carries it out too.
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
from schema.wire.codec import decode_robot
from schema.wire.operator import (
    GetStatus,
    InsertRobot,
    ListRobots,
    OperatorReply,
    OperatorRequest,
    PauseArena,
    RemoveRobot,
    ResumeArena,
    SaveSnapshot,
    SetBrain,
    decode_operator_request,
    encode_operator_reply,
)


class Refused(RevolveError):  # noqa: N818 - reads as what it says
    """A request that cannot be carried out; the reply says why."""


class RunOperator:
    """Carries out the operator requests of one run."""

    def __init__(self, loop: Loop, experiment: Experiment) -> None:
        """Initialise for a loop that has started."""
        self._loop = loop
        self._experiment = experiment

    def reply_to(self, request: OperatorRequest) -> OperatorReply:
        """Carry out a request and return the reply.

        On return the journal holds the order. A faulty request is refused and
        changes nothing.

        Raises:
            RunFolderError: the disk is full or failed.
        """
        event = None
        assert not isinstance(request.action, GetStatus)  # OperatorServer replies
        try:
            arena = self._arena(request.island)
            match request.action:
                case ListRobots():
                    text = self._list(arena, request.island)
                case SaveSnapshot():
                    self._loop.shard_requests.request_snapshot(request.island)
                    text = "the state is saved at the end of the next advance"
                case action:
                    order = self._order(action, arena)
                    event = Commanded(
                        request.island, request.request_id, arena.next_step, order
                    )
                    step_s = self._own(request.island).simulation.timestep_s
                    text = f"takes effect at {event.step * step_s:g} s"
        except RevolveError as error:
            return OperatorReply(str(error), is_refused=True)
        if event is not None:
            self._loop.order(event)
        return OperatorReply(text)

    def _arena(self, number: int) -> Arena:
        arena = self._loop.islands.get(number)
        if not isinstance(arena, Arena):
            raise Refused(f"island {number}: no arena of this run")
        if arena.is_finished:
            raise Refused(f"arena {number}: has finished")
        return arena

    def _order(
        self,
        action: PauseArena | ResumeArena | InsertRobot | RemoveRobot | SetBrain,
        arena: Arena,
    ) -> Order:
        """Return the order of an action.

        Raises:
            Refused: no living robot has the given birth number.
            InvalidRobot: a robot that breaks the rules of the experiment.
        """
        order: Order
        match action:
            case PauseArena():
                order = Pause()
            case ResumeArena():
                order = Resume()
            case InsertRobot():
                robot = decode_robot(action.robot)
                check_robot(robot, body_space(self._experiment.space))
                order = Insert(genome_of(robot), action.place)
            case RemoveRobot():
                _check_lives(action.birth, arena)
                order = Remove(action.birth)
            case SetBrain():
                _check_lives(action.birth, arena)
                order = ReplaceBrain(action.birth, decode_robot(action.robot).brain)
        check_order(order, self._experiment)
        return order

    def _own(self, island: int) -> Experiment:
        return island_experiment(self._experiment, island)

    def _list(self, arena: Arena, island: int) -> str:
        """Return a line about the arena and one about each living robot."""
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
        numbers = ", ".join(str(each.number) for each in living) or "none"
        raise Refused(f"birth {birth.number}: is not alive; alive are {numbers}")


class OperatorServer:
    """Answers operator requests of all runs of a coordinator."""

    def __init__(self, scheduler: RunScheduler) -> None:
        self._scheduler = scheduler

    def answer(self, data: bytes, now_s: float) -> bytes:
        """Return the encoded reply to an encoded request.

        Args:
            data: of an ``OperatorRequest``.
            now_s: the time, of any clock that only goes forward [s].
        """
        try:
            request = decode_operator_request(data)
            if isinstance(request.action, GetStatus):
                reply = OperatorReply("", status=self._scheduler.status(now_s))
            else:
                reply = self._carry_out(request, self._run(request.run))
        except (MalformedMessage, Refused) as error:
            reply = OperatorReply(str(error), is_refused=True)
        return encode_operator_reply(reply)

    def _carry_out(self, request: OperatorRequest, run: RunSession) -> OperatorReply:
        """Return the reply of a run; a run that fails here is stopped."""
        if run.recovery is not None:
            done, total = run.recovery.progress
            return OperatorReply(
                f"lost poses are computed again (advance {done} of {total}): try again "
                "when that is done",
                is_refused=True,
            )
        replies: list[OperatorReply] = []
        operator = RunOperator(run.loop, run.experiment)
        self._scheduler.guard(run, lambda: replies.append(operator.reply_to(request)))
        if replies:
            return replies[0]
        return OperatorReply("the run cannot go on", is_refused=True)

    def _run(self, name: str) -> RunSession:
        """Return the run whose folder's name ends with a name.

        Raises:
            Refused: no running run with an arena has such a name, or several have.
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
        raise Refused(
            f"the name must match one running run with an arena; matching: {names}"
        )
