"""Arena shards that continue on another platform, where results may differ."""

from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass

from msgspec.structs import replace

from coordinator.islands.events import Record
from schema.parts import Vector
from schema.robot.ids import BirthId
from schema.wire.arena import Advance, Casualty


@dataclass(frozen=True, slots=True)
class Drift:
    """A shard was continued by a worker of another platform.

    Attributes:
        step: the first one that was reached there.
        before, after: the platforms.
        worker: that continued it.
    """

    island: int
    step: int
    before: str
    after: str
    worker: str

    @property
    def record(self) -> Record:
        """Row of the drifts table."""
        return Record("drifts", asdict(self))

    def __str__(self) -> str:
        return (
            f"arena {self.island}: worker {self.worker} continues it to step "
            f"{self.step} on {self.after}, after {self.before}: from here on results "
            "differ from those of a run on one platform"
        )


def with_losses(
    advance: Advance,
    step: int,
    places: Mapping[BirthId, Vector],
    removals: Collection[BirthId],
) -> Advance:
    """Return the first advance after a drift, with the robots that the drift lost.

    A rebuilt arena need not hold all robots that lived before the drift, and the
    advance does not report those that are missing.

    ``step``: at which the advance began. ``places``: of the robots that lived at that
    step. ``removals``: robots that were removed at that step.
    """
    known = {one.birth for one in advance.judgements}
    known.update(one.birth for one in advance.casualties)
    known.update(removals)
    lost = tuple(
        Casualty(birth, step, "lost in a drift between platforms", place)
        for birth, place in places.items()
        if birth not in known
    )
    return replace(advance, casualties=lost + advance.casualties)
