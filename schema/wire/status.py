"""How far runs are: what a coordinator tells, and what a folder tells without one."""

from dataclasses import dataclass

from schema.wire import revolve_pb2 as pb
from schema.wire.messages import finite


@dataclass(frozen=True, slots=True)
class IslandStatus:
    """How far an island is.

    Attributes:
        births: so far.
        wanted: births at the end.
        best: greatest fitness of the living; None if nobody is judged.
        alive: how many live.
        simulated_s: how long an arena has lived [s]; None off-line.
        is_paused: an operator lets it stand still.
    """

    births: int
    wanted: int
    best: float | None
    alive: int
    simulated_s: float | None = None
    is_paused: bool = False


@dataclass(frozen=True, slots=True)
class RunStatus:
    """How far a run is.

    Attributes:
        folder: where it is kept.
        name: of the experiment.
        run: number of the repeat.
        state: "waiting", "running", "stopped", "finished" or "failed".
        births_per_s: lately [1/s].
        islands: by their numbers; none if nothing is known of them yet.
        simulated_per_s: simulated seconds per second, of all arenas, lately.
    """

    folder: str
    name: str
    run: int
    state: str
    births_per_s: float = 0.0
    islands: tuple[IslandStatus, ...] = ()
    simulated_per_s: float = 0.0

    @property
    def births(self) -> int:
        """How many have been born on all islands."""
        return sum(island.births for island in self.islands)

    @property
    def wanted(self) -> int:
        """How many are to be born on all islands."""
        return sum(island.wanted for island in self.islands)


@dataclass(frozen=True, slots=True)
class Status:
    """How far all runs of a coordinator are.

    Attributes:
        runs: in the order in which they are begun.
        workers, analyzers: how many are there.
        births_per_s: of all runs, lately [1/s].
    """

    runs: tuple[RunStatus, ...]
    workers: int
    analyzers: int
    births_per_s: float

    @property
    def births(self) -> int:
        """How many have been born in all runs."""
        return sum(run.births for run in self.runs)

    @property
    def wanted(self) -> int:
        """How many are to be born in all runs."""
        return sum(run.wanted for run in self.runs)

    @property
    def left_s(self) -> float | None:
        """How long it will take if it goes on like this [s]; None if it stands."""
        open_runs = [run for run in self.runs if run.state in ("waiting", "running")]
        left = sum(run.wanted - run.births for run in open_runs)
        if not left:
            return 0.0
        return left / self.births_per_s if self.births_per_s else None


def status_to_message(status: Status) -> pb.Status:
    """Return a status as a message."""
    return pb.Status(
        runs=[_run_to_message(run) for run in status.runs],
        workers=status.workers,
        analyzers=status.analyzers,
        births_per_s=status.births_per_s,
    )


def status_from_message(message: pb.Status) -> Status:
    """Return the status of a message.

    Raises:
        MalformedMessage: a number that is not finite.
    """
    return Status(
        tuple(map(_run_from_message, message.runs)),
        message.workers,
        message.analyzers,
        finite(message.births_per_s, "status.births_per_s"),
    )


def _run_to_message(run: RunStatus) -> pb.RunStatus:
    return pb.RunStatus(
        folder=run.folder,
        name=run.name,
        run=run.run,
        state=run.state,
        births_per_s=run.births_per_s,
        simulated_per_s=run.simulated_per_s,
        islands=[
            pb.IslandStatus(
                births=island.births,
                wanted=island.wanted,
                has_best=island.best is not None,
                best=island.best or 0.0,
                alive=island.alive,
                is_arena=island.simulated_s is not None,
                simulated_s=island.simulated_s or 0.0,
                is_paused=island.is_paused,
            )
            for island in run.islands
        ],
    )


def _run_from_message(message: pb.RunStatus) -> RunStatus:
    islands = []
    for island in message.islands:
        best = finite(island.best, "status.best")
        simulated_s = finite(island.simulated_s, "status.simulated_s")
        islands.append(
            IslandStatus(
                births=island.births,
                wanted=island.wanted,
                best=best if island.has_best else None,
                alive=island.alive,
                simulated_s=simulated_s if island.is_arena else None,
                is_paused=island.is_paused,
            )
        )
    return RunStatus(
        folder=message.folder,
        name=message.name,
        run=message.run,
        state=message.state,
        births_per_s=finite(message.births_per_s, "status.births_per_s"),
        islands=tuple(islands),
        simulated_per_s=finite(message.simulated_per_s, "status.simulated_per_s"),
    )
