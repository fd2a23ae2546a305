"""Figures of runs as text for a terminal."""

from collections.abc import Mapping, Sequence

from coordinator.dispatch.faults import MEANINGS
from schema.errors import counted, rounded
from schema.wire.status import IslandStatus, PeerFault, RunStatus, Status

_MOST_PEERS = 5
_MEANINGS = {str(kind): meaning for kind, meaning in MEANINGS.items()}
_MINUTE_S, _HOUR_S, _DAY_S = 60, 3600, 86400


def duration(seconds: float | None) -> str:
    """Return a duration as text, such as "2 h 05 min"; "?" if it is unknown."""
    if seconds is None:
        return "?"
    whole = round(seconds)
    if whole >= _DAY_S:
        return f"{whole // _DAY_S} d {whole % _DAY_S // _HOUR_S} h"
    if whole >= _HOUR_S:
        return f"{whole // _HOUR_S} h {whole % _HOUR_S // _MINUTE_S:02} min"
    if whole >= _MINUTE_S:
        return f"{whole // _MINUTE_S} min {whole % _MINUTE_S:02} s"
    return f"{whole} s"


def run_details(run: RunStatus) -> str:
    """Return the best fitness of a run, and the state of its arenas."""
    return f"{best_text(run)}{about_arenas(run)}"


def best_text(counted: RunStatus | IslandStatus) -> str:
    """Return the best fitness of the living robots, per island if there are few."""
    islands = counted.islands if isinstance(counted, RunStatus) else (counted,)
    bests = [island.best for island in islands]
    judged = [best for best in bests if best is not None]
    if not judged:
        return "best -"
    if 1 < len(bests) <= 8:  # noqa: PLR2004 - as many as a line holds
        each = " ".join("-" if best is None else rounded(best, 3) for best in bests)
        return f"best {each}"
    return f"best {rounded(max(judged), 3)}"


def missing_agents(status: Status) -> list[str]:
    """Return the kinds of agents that a coordinator has none of, in the plural."""
    counts = {"workers": status.workers, "analyzers": status.analyzers}
    return [kind for kind, count in counts.items() if not count]


def state_of(run: RunStatus, status: Status, *, is_live: bool) -> str:
    """Return the state of a run for a table.

    Args:
        run: one run of the status.
        status: of all runs.
        is_live: a coordinator reported it, so that its agents are known.
    """
    missing = missing_agents(status)
    if is_live and missing and run.state == "running":
        return f"waiting for {' and '.join(missing)}"
    return run.state


def about_arenas(run: RunStatus) -> str:
    """Return simulated time and number of robots of a run's arenas, if it has any."""
    arenas = [island for island in run.islands if island.simulated_s is not None]
    if not arenas:
        return ""
    simulated_s = sum(island.simulated_s or 0.0 for island in arenas)
    alive = sum(island.alive for island in arenas)
    pace = ", paused" if any(island.is_paused for island in arenas) else ""
    if run.simulated_per_s:
        pace = f"{pace}, {run.simulated_per_s:.1f} x real time"
    return f", {simulated_s:.0f} s simulated, {alive} alive{pace}"


def silent_lines(silent: Mapping[str, int]) -> list[str]:
    """Return a line that names the agents that hold jobs and do not answer, if any."""
    held = ", ".join(f"{name} holds {counted(n, 'job')}" for name, n in silent.items())
    return [f"no answer and no progress: {held}"] if silent else []


def fault_lines(faults: Sequence[PeerFault]) -> list[str]:
    """Return a line for each kind of fault: its total, and the peers with the most."""
    lines = []
    for kind in sorted({each.kind for each in faults}):
        of_kind = sorted(
            (each for each in faults if each.kind == kind),
            key=lambda each: (-each.count, each.peer),
        )
        total = sum(each.count for each in of_kind)
        peers = ", ".join(f"{each.peer} {each.count}" for each in of_kind[:_MOST_PEERS])
        more = f" and {len(of_kind) - _MOST_PEERS} more" * (len(of_kind) > _MOST_PEERS)
        # A coordinator of another version may have other kinds.
        meaning = _MEANINGS.get(kind, "")
        when = f"{meaning}; since the start" if meaning else "since the start"
        lines.append(f"not used: {total} {kind}: {peers}{more} ({when})")
    return lines
