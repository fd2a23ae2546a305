"""What a run shows while it lives: one line per island on the terminal."""

from collections import deque
from time import monotonic
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)

from coordinator.arena import Arena
from coordinator.dispatch import Dispatch
from coordinator.island import Island
from coordinator.loop import Loop
from schema.experiment import Experiment

_RATE_SPAN_S = 10.0


class Display:
    """Progress bars of a run; a line every so often where there is no terminal."""

    def __init__(
        self, loop: Loop, dispatch: Dispatch, experiment: Experiment, *, quiet: bool
    ) -> None:
        """Show ``loop``, each of whose islands is run as ``experiment`` says."""
        self._loop = loop
        self._dispatch = dispatch
        self._births = experiment.births
        self._step_s = experiment.simulation.timestep_s
        self._console = Console(stderr=True)
        self._quiet = quiet
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("births"),
            TextColumn("{task.fields[rate]:5.1f}/s"),
            TextColumn("{task.fields[workers]} workers"),
            TextColumn("best {task.fields[best]}{task.fields[arena]}"),
            TimeRemainingColumn(),
            console=self._console,
            disable=quiet or not self._console.is_terminal,
        )
        self._tasks: dict[int, TaskID] = {}
        self._seen: deque[tuple[float, int, int]] = deque()
        self._next_line_s = 0.0
        self._waits_since: float | None = None
        self._said_waiting: dict[int, str] = {}

    def __enter__(self) -> Self:
        """Start drawing."""
        for number, island in sorted(self._loop.islands.items()):
            self._tasks[number] = self._progress.add_task(
                f"island {number}",
                total=self._births,
                completed=island.births,
                rate=0.0,
                workers=0,
                best="-",
                arena="",
            )
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the last state on the screen."""
        self.update()
        self._progress.stop()

    def update(self) -> None:
        """Show the present state."""
        if self._quiet:
            return
        now_s = monotonic()
        islands = self._loop.islands.values()
        born = sum(island.births for island in islands)
        steps = sum(island.step for island in islands if isinstance(island, Arena))
        self._seen.append((now_s, born, steps))
        while now_s - self._seen[0][0] > _RATE_SPAN_S:
            self._seen.popleft()
        first_s, first_born, first_steps = self._seen[0]
        span_s = now_s - first_s
        rate = (born - first_born) / span_s if span_s > 0 else 0.0
        # Simulated seconds per second, of all arenas together.
        speed = (steps - first_steps) * self._step_s / span_s if span_s > 0 else 0.0
        arenas = ""
        workers = self._dispatch.agents("worker")
        for number, island in self._loop.islands.items():
            best = max((one.fitness for one in island.population), default=None)
            arena = self._about(island, speed)
            arenas += arena
            self._progress.update(
                self._tasks[number],
                completed=island.births,
                rate=rate,
                workers=workers,
                best="-" if best is None else f"{best:.3f}",
                arena=arena,
            )
        self._say_who_is_missing(now_s)
        if not self._console.is_terminal and now_s >= self._next_line_s:
            self._next_line_s = now_s + _RATE_SPAN_S
            self._console.print(
                f"{born} of {self._births * len(self._tasks)} births, "
                f"{rate:.1f}/s, {workers} workers{arenas}"
            )

    def _about(self, island: Island | Arena, speed: float) -> str:
        """Return what there is to say of an arena beside its births."""
        if not isinstance(island, Arena):
            return ""
        pace = "paused" if island.is_paused else f"{speed:.1f} x real time"
        return (
            f", {island.step * self._step_s:.0f} s simulated, "
            f"{len(island.population)} alive, {pace}"
        )

    def _say_who_is_missing(self, now_s: float) -> None:
        """Say once, after a while, that nobody is there to do the work."""
        missing = [
            kind for kind in ("worker", "analyzer") if not self._dispatch.agents(kind)
        ]
        if not missing:
            self._waits_since = None
        elif self._waits_since is None:
            self._waits_since = now_s
        elif now_s - self._waits_since > _RATE_SPAN_S:
            self._waits_since = now_s + 6 * _RATE_SPAN_S
            self._console.print(f"waiting: no {' and no '.join(missing)} has joined")
        waiting = self._loop.advances.waiting
        if "worker" not in missing and waiting != self._said_waiting:
            self._said_waiting = dict(waiting)
            for shard, platform in waiting.items():
                self._console.print(
                    f"waiting: no worker of platform {platform} is there to go on "
                    f"with arena {shard}; others would come to other results"
                )
