"""Active arenas as the Python API has them: what lives there, and orders."""

from argparse import Namespace
from os import fspath
from pathlib import Path

from coordinator.cli.arena import coordinator_of, send
from revolve.arguments import (
    finite_numbers,
    in_order,
    naming_arguments,
    whole_number,
)
from revolve.robot import Robot, plain
from revolve.runs import Run
from schema.agent.network import DEFAULT_FLEET
from schema.errors import RevolveError
from schema.robot.ids import BirthId
from schema.robot.robot import Robot as PlainRobot
from schema.wire.operator import (
    MOST_PARENTS,
    ArenaListing,
    InsertRobot,
    ListedRobot,
    ListRobots,
    OperatorAction,
    OperatorReply,
    PauseArena,
    RemoveRobot,
    ResumeArena,
    SaveSnapshot,
    SetBrain,
)


class Arena:
    """An arena of an active run, which takes orders as ``revolve arena`` gives them.

    An order takes effect at the arena's next decision, and the journal of the run has
    it before the method returns. Robots are named by their number of birth, or as
    ``robots`` lists them.
    """

    def __init__(
        self,
        connect: Run | str | Path | None = None,
        *,
        island: int = 0,
        run: str = "",
        fleet: str = DEFAULT_FLEET,
        tls: tuple[str, str, str] | None = None,
    ) -> None:
        """Find an arena.

        Args:
            connect: folder of its run, or address of the hub; None: this user's hub.
            island: number of its island.
            run: name of the run's folder, or the end of one; empty: the only run.
            fleet: name of the fleet at the hub.
            tls: as for ``Fleet``.

        Raises:
            NetworkError: no active run is there, or not exactly one.
        """
        flags = ("tls_ca", "tls_certificate", "tls_key")
        self._options = Namespace(
            connect=None if connect is None else fspath(connect),
            island=whole_number("island", island),
            run=run,
            fleet=fleet,
            **dict(zip(flags, tls or (None, None, None), strict=True)),
        )
        with naming_arguments():
            self._coordinator, _ = coordinator_of(self._options)

    def listing(self) -> ArenaListing:
        """Return the simulated time of the arena, its births, and its living robots.

        Raises:
            RevolveError: it has finished, or is no arena.
            NetworkError: its coordinator does not answer.
        """
        listing = self._ask(ListRobots()).arena
        assert listing is not None
        return listing

    def robots(self) -> tuple[ListedRobot, ...]:
        """Return the living robots by birth; raises as ``listing``."""
        return self.listing().robots

    def insert(
        self,
        robot: Robot | PlainRobot,
        place: tuple[float, float] | None = None,
        parents: "tuple[int | ListedRobot, ...]" = (),
    ) -> float:
        """Insert a robot, which may mate like any other.

        Args:
            robot: to insert.
            place: of its core in the ground plane, world frame [m]; None: drawn.
            parents: up to two living robots that count as its parents.

        Returns:
            The simulated time at which it takes effect [s]; later if there is no room.

        Raises:
            RevolveError: the arena refuses it, and says why.
            NetworkError: its coordinator does not answer.
        """
        names = tuple(map(self._birth, in_order("parents", parents)))
        if len(names) > MOST_PARENTS:
            rule = f"parents: must be at most {MOST_PARENTS} robots"
            raise RevolveError(f"{rule}, got {len(names)}")
        if place is not None:
            x, y = finite_numbers("place", place, 2, ", x and y [m]").tolist()
            place = x, y
        return self._order(InsertRobot(plain(robot), place, names))

    def remove(self, robot: int | ListedRobot) -> float:
        """Remove a robot; returns and raises as ``insert``."""
        return self._order(RemoveRobot(self._birth(robot)))

    def replace_brain(
        self, robot: int | ListedRobot, other: Robot | PlainRobot
    ) -> float:
        """Give a robot the brain of another one; returns and raises as ``insert``."""
        return self._order(SetBrain(self._birth(robot), plain(other)))

    def pause(self) -> float:
        """Pause the arena; returns and raises as ``insert``."""
        return self._order(PauseArena())

    def resume(self) -> float:
        """Resume a paused arena; returns and raises as ``insert``."""
        return self._order(ResumeArena())

    def snapshot(self) -> None:
        """Save the state at the end of the next advance; raises as ``insert``."""
        self._ask(SaveSnapshot())

    def _order(self, action: OperatorAction) -> float:
        effect_s = self._ask(action).effect_s
        assert effect_s is not None
        return effect_s

    def _ask(self, action: OperatorAction) -> OperatorReply:
        reply = send(self._options, action, self._coordinator)
        if reply.is_refused:
            raise RevolveError(reply.text)
        return reply

    def _birth(self, robot: int | ListedRobot) -> BirthId:
        if isinstance(robot, ListedRobot):
            return robot.birth
        return BirthId(self._options.island, whole_number("birth", robot))
