"""Lifetime learning: the trials of an island's newborns.

The brain at birth is tried first, with samples: brains of parents and peers. Then the
island asks the learner of a newborn for parameters, evaluates all trials of the
answer, and asks again until the budget is spent: off-line together, in an arena one by
one. Answers of learners are events, as evaluations are: a replay does not need the
learners.
"""

from collections.abc import Sequence
from math import inf, sqrt

from msgspec.structs import replace

from coordinator.evolution.breeding import Candidate, Individual
from coordinator.evolution.encodings import IslandEncoding
from coordinator.evolution.learners.brain_parameters import BrainParameters
from coordinator.evolution.learners.learner import Batch, Points, learner_class
from coordinator.islands.events import Ask, Asked, Outcome, Record
from schema.errors import ExperimentError, UnexpectedEvent
from schema.experiment.document import Experiment
from schema.experiment.learning import PARENTS, Learning
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.robot.trace import sum_in_order
from schema.wire.messages import Evaluate


class IslandLearning:
    """What all newborns of an island that learns have in common: what they learn."""

    def __init__(self, experiment: Experiment, encoding: IslandEncoding) -> None:
        """Initialise.

        Raises:
            ExperimentError: what is learnt cannot be inherited with this encoding, or
                as of ``learner_class``.
        """
        assert experiment.learning is not None
        self.rules: Learning = experiment.learning
        self._encoding = encoding
        self._is_lamarckian = self.rules.inherit == "lamarckian"
        if self._is_lamarckian and not encoding.describes_robots:
            raise ExperimentError(
                "learning.inherit: must be 'darwinian' with encoding.type = "
                f"{encoding.name!r}: it has no method from_robot"
            )
        # A run refuses wrong parameters before its first birth.
        learner_class(self.rules)
        self.parameters = BrainParameters(
            self.rules, experiment.brain, experiment.space
        )

    def samples(
        self, candidate: Candidate, population: Sequence[Individual]
    ) -> dict[tuple[float, ...], BirthId]:
        """Return brains of parents, then of the fittest others of a population.

        Each has the parameters that its robot and the newborn have in common, and the
        newborn's own others. One that is equal to an earlier one, or to the newborn's
        own, counts for nothing.

        Returns:
            The births whose brains they are, by parameters as shares of their ranges.
        """
        rules = self.rules
        if not rules.samples:
            return {}
        parents = (candidate.couple or ()) if rules.inherit == "samples" else ()
        births = {one.birth for one in parents}
        others = [
            one for one in population if not (one.has_failed or one.birth in births)
        ]
        others.sort(key=lambda one: (-one.fitness, one.birth))
        own = self.parameters.read(candidate.robot)
        found = {own: candidate.birth}
        for group, count in ((parents, PARENTS), (others, rules.peers)):
            most = len(found) + count
            for one in group:
                if len(found) == most:
                    break
                robot = one.learnt or self._encoding.robot_of(one.genome)
                sample = self.parameters.sample(candidate.robot, robot)
                if sample is not None:
                    found.setdefault(sample, one.birth)
        del found[own]
        return found

    def grown(self, candidate: Candidate, robot: Robot) -> Candidate:
        """Return a newborn with the brain that it has learnt.

        Raises:
            InvalidRobot: an own encoding cannot describe the robot.
        """
        if robot is candidate.robot:
            return candidate
        if self._is_lamarckian:
            grown = self._encoding.with_brain(candidate.genome, robot)
            return replace(
                candidate,
                genome=grown.genome,
                robot=robot,
                connections=grown.connections,
            )
        return replace(candidate, learnt=robot)


class NewbornLearning:
    """The trials of one newborn; it ``is_waiting`` while its learner is asked."""

    def __init__(
        self,
        candidate: Candidate,
        island: IslandLearning,
        population: Sequence[Individual],
    ) -> None:
        """Initialise; peers are of the population, which is that at the birth."""
        self._candidate = candidate
        self._island = island
        own = island.parameters.read(candidate.robot)
        # With nothing to learn, a second trial would be the first one again.
        self._budget = island.rules.budget if own else 1
        samples = island.samples(candidate, population)
        # Parameters and outcome of each trial, and number of its request.
        self._points: list[tuple[float, ...]] = [own, *samples]
        self._sample_of = [None, *samples.values()]
        self._outcomes: list[Outcome | None] = [None] * len(self._points)
        self._requests = [0] * len(self._points)
        # The trial at which the learner begins, once the first ones are known.
        self._start = 0
        self._first = len(self._points)
        self._told: tuple[Batch, ...] = ()
        self.is_waiting = self.learns and not samples

    @property
    def learns(self) -> bool:
        """There are trials of other brains than that at birth."""
        return self._budget > 1

    @property
    def best(self) -> int:
        """Number of the best trial; of equal ones the first."""
        trials = range(len(self._outcomes))
        return max(trials, key=lambda trial: _told_fitness(self._outcomes[trial]))

    @property
    def is_done(self) -> bool:
        """All trials have an outcome."""
        return len(self._outcomes) == self._budget and None not in self._outcomes

    def start(self) -> list[Evaluate | Ask]:
        """Return the first trials; without samples, the first request, too."""
        trials = self._trials(0)
        return [*trials, self._ask()] if self.is_waiting else [*trials]

    def take(self, event: Outcome | Asked) -> list[Evaluate | Ask]:
        """Take an answer; return what follows from it. Duplicates are ignored.

        Raises:
            UnexpectedEvent: the answer to a request that was never sent.
        """
        if isinstance(event, Asked):
            return self._begin(event)
        if event.trial >= len(self._outcomes):
            raise self._unexpected(event)
        if self._outcomes[event.trial] is not None:
            return []
        self._outcomes[event.trial] = event
        if self.is_waiting or None in self._outcomes or self.is_done:
            return []
        if len(self._points) == self._first:
            self._start = self.best
        else:
            self._tell()
        self.is_waiting = True
        return [self._ask()]

    def _begin(self, event: Asked) -> list[Evaluate | Ask]:
        """Begin the trials that the learner wants."""
        known = len(self._told)
        if event.number < known or (event.number == known and not self.is_waiting):
            return []
        left = self._budget - len(self._points)
        is_wrong = any(len(each) != len(self._points[0]) for each in event.points)
        if event.number > known or not 1 <= len(event.points) <= left or is_wrong:
            raise self._unexpected(event)
        self.is_waiting = False
        first = len(self._points)
        self._points += event.points
        self._outcomes += [None] * len(event.points)
        self._requests += [event.number] * len(event.points)
        self._sample_of += [None] * len(event.points)
        return [*self._trials(first)]

    def _trials(self, first: int) -> list[Evaluate]:
        """Return the trials from one on."""
        birth = self._candidate.birth
        return [
            Evaluate(birth, self._robot(trial), trial)
            for trial in range(first, len(self._points))
        ]

    def _tell(self) -> None:
        """Note what the learner is to be told: all trials of the last request."""
        number = len(self._told)
        asked = range(self._first, len(self._points))
        trials = [trial for trial in asked if self._requests[trial] == number]
        if not number:
            trials = [self._start, *trials]
        points: Points = tuple(self._points[trial] for trial in trials)
        fitness = tuple(_told_fitness(self._outcomes[trial]) for trial in trials)
        self._told = (*self._told, (points, fitness))

    def _ask(self) -> Ask:
        left = self._budget - len(self._points)
        start, number = self._points[self._start], len(self._told)
        return Ask(self._candidate.birth, number, start, left, self._told)

    def _robot(self, trial: int) -> Robot:
        """Return the robot of a trial."""
        robot = self._candidate.robot
        if not trial:
            # The brain at birth may have values outside the ranges.
            return robot
        return self._island.parameters.written(robot, self._points[trial])

    def conclude(self) -> tuple[Candidate, Outcome]:
        """Return the newborn with its best brain, and that trial's outcome.

        Of equal trials the first counts. If all failed, it is the brain at birth with
        its failure.
        """
        best = self.best
        outcome = self._outcomes[best]
        assert outcome is not None
        grown = self._island.grown(self._candidate, self._robot(best))
        return grown, replace(outcome, trial=0)

    def records(self) -> list[Record]:
        """Return the rows of the trials that have an outcome."""
        return [
            self._record(trial, outcome)
            for trial, outcome in enumerate(self._outcomes)
            if outcome is not None
        ]

    def _record(self, trial: int, outcome: Outcome) -> Record:
        point, own = self._points[trial], self._points[0]
        squares = [(to - old) ** 2 for to, old in zip(point, own, strict=True)]
        sample = self._sample_of[trial]
        row = {
            "island": outcome.birth.island,
            "birth": outcome.birth.number,
            "trial": trial,
            "request": self._requests[trial],
            "fitness": outcome.evaluation and outcome.evaluation.fitness,
            "reason": outcome.reason,
            "distance": sqrt(sum_in_order(squares) / len(squares)) if squares else 0.0,
            "parameters": point,
            "wall_s": outcome.provenance.wall_s,
            "worker": outcome.provenance.agent,
            "platform": outcome.provenance.platform,
            "sim_time_s": None,
            "robot": None,
            "sample_island": sample and sample.island,
            "sample_birth": sample and sample.number,
        }
        return Record("learning", row)

    def _unexpected(self, event: Outcome | Asked) -> UnexpectedEvent:
        return UnexpectedEvent(
            f"birth {self._candidate.birth} has {len(self._points)} of {self._budget} "
            f"trials and {len(self._told)} requests that are done, got {event}"
        )


def _told_fitness(outcome: Outcome | None) -> float:
    """Return the fitness of a trial; -inf if it failed."""
    found = outcome and outcome.evaluation
    return found.fitness if found else -inf
