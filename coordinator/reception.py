"""Where everybody is received who wants something of a coordinator."""

from coordinator.active import ActiveRun
from coordinator.arena import Arena
from coordinator.conductor import Conductor
from coordinator.operator import Desk, Refused
from schema.errors import MalformedMessage
from schema.operator_codec import (
    OperatorReply,
    StatusWish,
    decode_operator_request,
    encode_operator_reply,
)


class Reception:
    """Tells how far all runs are; leads operators to the desk of theirs."""

    def __init__(self, conductor: Conductor) -> None:
        """Receive for all runs of a process."""
        self._conductor = conductor

    def answer(self, data: bytes, now_s: float) -> bytes:
        """Return the encoded reply to an encoded request.

        Args:
            data: of an ``OperatorRequest``.
            now_s: the time, of any clock that only goes forward [s].
        """
        try:
            request = decode_operator_request(data)
            if isinstance(request.wish, StatusWish):
                status = self._conductor.status(now_s)
                return encode_operator_reply(OperatorReply("", status=status))
            run = self._run(request.run)
        except (MalformedMessage, Refused) as error:
            return encode_operator_reply(OperatorReply(str(error), is_refused=True))
        replies: list[bytes] = []
        desk = Desk(run.loop, run.experiment)
        self._conductor.guard(run, lambda: replies.append(desk.answer(data)))
        if replies:
            return replies[0]
        failed = OperatorReply("the run cannot go on", is_refused=True)
        return encode_operator_reply(failed)

    def _run(self, name: str) -> ActiveRun:
        """Return whose operator asks.

        Raises:
            Refused: not exactly one run is meant.
        """
        runs = [
            run
            for run in self._conductor.active
            if run.held.path.name.endswith(name)
            and any(isinstance(each, Arena) for each in run.loop.islands.values())
        ]
        if len(runs) == 1:
            return runs[0]
        names = ", ".join(sorted(run.held.path.name for run in runs)) or "none"
        raise Refused(f"one run with an arena must be meant; running are {names}")
