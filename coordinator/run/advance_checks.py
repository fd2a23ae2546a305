"""Checks of advances and poses against their requests and the state of their arenas.

An advance that passes names exactly the robots that live, and its steps follow from the
request; so no state machine raises for it. A plausible number that is wrong passes.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from collections.abc import Set as AbstractSet
from itertools import pairwise

from msgspec import Struct
from msgspec.structs import replace

from coordinator.run.requests import check_count, impossible
from schema.errors import NO_MESSAGE
from schema.experiment.document import Experiment
from schema.limits import LONGEST_REASON, printable
from schema.robot.ids import BirthId
from schema.wire.arena import Advance, Casualty, Touch
from schema.wire.arena_state import state_digest
from schema.wire.poses import PoseArrays

_SHOWN = 3
"""Robots that a message names."""


class ExpectedAdvance(Struct, frozen=True):
    """What a correct result of an advance has.

    Attributes:
        from_step, until: steps of the request.
        living: robots that live after the requested changes.
        wants_snapshot: the result must hold the state at the end.
        wants_tracks: the result must hold the work of the motors.
        judges: the advance ends, so each robot is judged.
    """

    from_step: int
    until: int
    living: AbstractSet[BirthId]
    experiment: Experiment
    wants_snapshot: bool
    wants_tracks: bool = False
    judges: bool = True

    @property
    def samples(self) -> range:
        """Steps at which poses are recorded."""
        interval = self.experiment.simulation.pose_steps
        first = self.from_step // interval + 1
        return range(first * interval, self.until + 1, interval)


def check_advance(advance: Advance, expected: ExpectedAdvance) -> None:
    """Raise unless an advance is a result of its request; poses are not checked.

    Raises:
        MalformedMessage: another step; unknown, missing or repeated robots; another
            number of measures or works; tracks; a snapshot that is missing, was not
            wanted, or is that of another state.
    """
    if advance.step != expected.until:
        raise impossible(
            f"advance: must reach step {expected.until}, got {advance.step}"
        )
    if bool(advance.snapshot) != expected.wants_snapshot:
        wanted, got = ("a", "none") if expected.wants_snapshot else ("no", "one")
        raise impossible(f"advance: {wanted} snapshot was wanted, got {got}")
    if advance.snapshot and state_digest(advance.snapshot) != advance.digest:
        raise impossible("advance: the snapshot must have the digest of the state")
    judged = [judgement.birth for judgement in advance.judgements]
    if expected.judges:
        check_robots(judged, advance.casualties, expected.living)
    elif judged:
        raise impossible(f"advance: no robot is judged yet, got {_names(judged)}")
    measures = len(expected.experiment.measures.names)
    for judgement in advance.judgements:
        if judgement.measures or judgement.is_mature:
            check_count(judgement.measures, measures)
    _check_work(advance, expected)
    last = expected.from_step
    for casualty in advance.casualties:
        if not last <= casualty.step <= expected.until:
            raise impossible(
                f"casualty {_names([casualty.birth])}: step must be in "
                f"{last}..{expected.until}, got {casualty.step}"
            )
        last = casualty.step
    _check_touches(advance.touches, expected)


def printable_reasons(casualties: Iterable[Casualty]) -> tuple[Casualty, ...]:
    """Return casualties whose reasons can be shown."""
    return tuple(
        replace(one, reason=printable(one.reason, LONGEST_REASON) or NO_MESSAGE)
        for one in casualties
    )


def check_robots(
    births: Sequence[BirthId],
    casualties: Sequence[Casualty],
    living: AbstractSet[BirthId],
) -> None:
    """Raise unless exactly the living robots are reported, each once.

    Raises:
        MalformedMessage: they are not; ``births`` do not ascend.
    """
    if any(a >= b for a, b in pairwise(births)):
        raise impossible("advance: robots must ascend by birth")
    reported = {*births, *(casualty.birth for casualty in casualties)}
    problems = []
    if unknown := reported - living:
        problems.append(f"unknown {_names(unknown)}")
    if missing := living - reported:
        problems.append(f"missing {_names(missing)}")
    if len(reported) < len(births) + len(casualties):
        problems.append("a robot is reported twice")
    if problems:
        raise impossible(
            "advance: must report each living robot once: " + ", ".join(problems)
        )


def _check_work(advance: Advance, expected: ExpectedAdvance) -> None:
    alive = len(expected.living) - len(advance.casualties)
    worked = alive if expected.wants_tracks else 0
    if len(advance.work_j) != worked or advance.tracks:
        got = f"{len(advance.work_j)} and {len(advance.tracks)} bytes of tracks"
        raise impossible(f"advance: must have {worked} works and no tracks, got {got}")


def _check_touches(touches: Sequence[Touch], expected: ExpectedAdvance) -> None:
    arena = expected.experiment.arena
    if touches and not (arena and arena.record_touches):
        raise impossible("advance: touches are not recorded, got some")
    pairs = [(touch.first, touch.second) for touch in touches]
    for pair in pairs:
        if pair[0] == pair[1] or not expected.living >= set(pair):
            raise impossible(
                f"touch: must be of two robots that live here, got {_names(pair)}"
            )
    if any(a >= b for a, b in pairwise(pairs)):
        raise impossible("advance: touches must ascend by pair")


def check_poses(advance: Advance, expected: ExpectedAdvance) -> int:
    """Raise unless poses are those of an advance; return their number.

    Raises:
        MalformedMessage: columns of different lengths; poses at other times, of robots
            that do not live here, repeated, missing or not finite; too many angles.
    """
    poses = PoseArrays.received(advance.poses)
    if not poses.are_finite:
        raise impossible("poses: must be finite")
    most = expected.experiment.space.max_parts
    if (poses.joints > most).any():
        raise impossible(f"poses: must have <= {most} angles each")
    robots, times = poses.robots, poses.times_s.tolist()
    if unknown := set(robots) - expected.living:
        raise impossible(f"poses: robots {_names(unknown)} do not live here")
    samples = expected.samples
    timestep_s = expected.experiment.simulation.timestep_s
    if not {step * timestep_s for step in samples} >= set(times):
        raise impossible(
            "poses: must be at multiples of simulation.pose_steps after step "
            f"{expected.from_step} up to {expected.until}"
        )
    if any(a > b for a, b in pairwise(times)):
        raise impossible("poses: times must ascend")
    if len(set(zip(robots, times, strict=True))) < len(robots):
        raise impossible("poses: must have one row per robot and time")
    counts = Counter(robots)
    for birth in expected.living - {lost.birth for lost in advance.casualties}:
        if counts[birth] != len(samples):
            raise impossible(
                f"poses: robot {_names([birth])} must have {len(samples)}, "
                f"got {counts[birth]}"
            )
    return len(robots)


def _names(births: Iterable[BirthId]) -> str:
    """Return the first of some births as text, and how many more there are."""
    ordered = sorted(births)
    shown = ", ".join(f"{one.island}/{one.number}" for one in ordered[:_SHOWN])
    more = len(ordered) - _SHOWN
    return f"{shown} and {more} more" if more > 0 else shown
