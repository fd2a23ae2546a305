"""Learners of a run's newborns: they answer what the islands ask."""

from collections.abc import Mapping
from dataclasses import dataclass

from coordinator.evolution.breeding import at_birth
from coordinator.evolution.learners.learner import NewbornLearner
from coordinator.evolution.random_streams import Purpose, stream
from coordinator.islands.events import Ask, Asked
from schema.experiment.document import Experiment
from schema.experiment.identity import Origin
from schema.robot.ids import BirthId

REMEMBERED = 256
"""Number of newborns whose learners are kept; others are made again when needed."""


@dataclass(slots=True)
class _Known:
    """A learner, and how many requests it was told the outcome of."""

    learner: NewbornLearner
    told: int = 0


class Learners:
    """The learners of all newborns in flight.

    A learner follows from what was tried, so it is not part of a run's state: after a
    restart, it is made again and told the trials that the journal holds.
    """

    def __init__(self, experiments: Mapping[int, Experiment], origin: Origin) -> None:
        """Initialise without learners, for the settings of each island."""
        self._experiments = experiments
        self._origin = origin
        self._known: dict[BirthId, _Known] = {}

    def answer(self, ask: Ask) -> Asked:
        """Return what the learner of a newborn wants to try.

        Raises:
            ExperimentError: the learner fails, or breaks its contract.
        """
        rules = self._experiments[ask.birth.island].learning
        assert rules is not None
        known = self._known.pop(ask.birth, None)
        seed, run = self._origin.seed, self._origin.run
        rng = stream(seed, run, ask.birth, ask.number, Purpose.LEARNING)
        with at_birth(ask.birth):
            if known is None:
                known = _Known(NewbornLearner(rules, ask.start))
            for batch in ask.told[known.told :]:
                known.learner.tell(batch)
            known.told = len(ask.told)
            points = known.learner.ask(rng, ask.most)
        if len(points) < ask.most:
            self._known[ask.birth] = known
            if len(self._known) > REMEMBERED:
                del self._known[next(iter(self._known))]
        return Asked(ask.birth, ask.number, points)
