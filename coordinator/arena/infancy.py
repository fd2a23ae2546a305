"""Infancy in an arena: newborns learn there, one window of fitness a trial.

A robot is an infant until its budget is spent. The first trial is its warm-up and its
first window; each further trial exchanges its brain in the running world, and is a
window that begins there. Time stands still while a learner is asked.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from msgspec.structs import replace

from coordinator.arena.living import LivingRobot, LivingRobots, Moment
from coordinator.evolution.breeding import Candidate
from coordinator.evolution.encodings import IslandEncoding
from coordinator.islands.events import (
    Advanced,
    Ask,
    Asked,
    Evaluated,
    EvaluationFailed,
    Record,
)
from coordinator.islands.learning import IslandLearning, NewbornLearning
from schema.experiment.document import Experiment
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance
from schema.robot.robot import Robot
from schema.wire.messages import Evaluate
from schema.wire.protobuf import encode_robot


@dataclass(slots=True)
class _Infant:
    """A robot that learns.

    Attributes:
        learning: its trials.
        end: step at which the present trial ends.
        trial: number of the present trial; None while its learner is asked for more.
        queue: trials to come.
        ended_s: simulated time at the end of each trial so far [s].
    """

    learning: NewbornLearning
    end: int
    trial: int | None = 0
    queue: deque[Evaluate] = field(default_factory=deque)
    ended_s: list[float] = field(default_factory=list)


class Infancy:
    """The infants of an arena whose robots learn, with a budget of several trials.

    An infant occupies a place of the population. It cannot be selected as a parent,
    culled, sent as a migrant or replaced by one.
    """

    def __init__(
        self, experiment: Experiment, encoding: IslandEncoding, living: LivingRobots
    ) -> None:
        """Initialise without infants.

        Raises:
            ExperimentError: as of ``IslandLearning``.
        """
        simulation = experiment.simulation
        self._island = IslandLearning(experiment, encoding)
        self._timestep_s = simulation.timestep_s
        self._warmup, self._window = simulation.warmup_steps, simulation.window_steps
        self._living = living
        self._infants: dict[BirthId, _Infant] = {}

    @property
    def is_waiting(self) -> bool:
        """A learner is asked."""
        return any(infant.learning.is_waiting for infant in self._infants.values())

    def next_end(self, until: int) -> int:
        """Return the step at which the next trial ends; at most ``until``."""
        return min([until, *(infant.end for infant in self._infants.values())])

    def begin(self, candidate: Candidate, step: int) -> list[Ask]:
        """Let a robot that has just been inserted learn, if there is anything to learn.

        Returns:
            The first request to its learner.
        """
        learning = NewbornLearning(candidate, self._island, self._living.mature())
        if not learning.learns:
            return []
        self._found(candidate.birth).is_infant = True
        end = step + self._warmup + self._window
        commands = learning.start()
        _, *samples = (each for each in commands if isinstance(each, Evaluate))
        self._infants[candidate.birth] = _Infant(learning, end, queue=deque(samples))
        return _asks(commands)

    def take(self, event: Asked, step: int) -> bool:
        """Take the trials that a learner wants; return whether they are new.

        Raises:
            UnexpectedEvent: the answer to a request that was never sent.
        """
        infant = self._infants.get(event.birth)
        if infant is None:
            return False
        trials = [
            each for each in infant.learning.take(event) if isinstance(each, Evaluate)
        ]
        infant.queue.extend(trials)
        if trials and infant.trial is None:
            self._try_next(event.birth, infant, step)
        return bool(trials)

    def end_trials(self, event: Advanced, moment: Moment) -> list[Ask | Record]:
        """End the trials whose window is whole, and those of robots that diverged.

        The living have taken the judgements of the event.

        Returns:
            Requests to learners; rows of robots that grew up or diverged.
        """
        commands: list[Ask | Record] = []
        for fallen in event.advance.casualties:
            died_s = fallen.step * self._timestep_s
            commands += self.end(fallen.birth, fallen.reason, died_s, event.provenance)
        for birth in sorted(self._infants):
            if self._infants[birth].end == event.advance.step:
                commands += self._judge(birth, event, moment)
        return commands

    def end(
        self,
        birth: BirthId,
        reason: str,
        now_s: float,
        provenance: Provenance = Provenance(),  # noqa: B008 - immutable
    ) -> list[Record]:
        """End an infancy before its time [s]; the present trial has failed.

        Returns:
            The rows of the infant's trials; none if the robot is no infant.
        """
        infant = self._infants.pop(birth, None)
        if infant is None:
            return []
        if (living := self._living.get(birth)) is not None:
            living.is_infant = False
        if infant.trial is not None:
            failed = EvaluationFailed(birth, reason, provenance, infant.trial)
            infant.learning.take(failed)
            infant.ended_s.append(now_s)
        return _rows(infant)

    def close(self) -> list[Record]:
        """End all infancies with the run; return the rows of the trials that ended."""
        infants, self._infants = self._infants, {}
        return [row for birth in sorted(infants) for row in _rows(infants[birth])]

    def _judge(
        self, birth: BirthId, event: Advanced, moment: Moment
    ) -> Sequence[Ask | Record]:
        infant, judgement = self._infants[birth], self._found(birth).judgement
        assert judgement is not None
        assert infant.trial is not None
        evaluation = Evaluation(
            judgement.fitness,
            judgement.path_velocity,
            judgement.straight_velocity,
            self._window * self._timestep_s,
            judgement.measures,
        )
        outcome = Evaluated(birth, evaluation, event.provenance, infant.trial)
        asks = _asks(infant.learning.take(outcome))
        infant.ended_s.append(moment.sim_time_s)
        infant.trial = None
        if infant.learning.is_done:
            return self._grow(birth)
        if infant.queue:
            self._try_next(birth, infant, event.advance.step)
        return asks

    def _try_next(self, birth: BirthId, infant: _Infant, step: int) -> None:
        """Exchange the brain for that of the next trial."""
        wanted = infant.queue.popleft()
        infant.trial, infant.end = wanted.trial, step + self._window
        self._living.replace_brain(
            self._found(birth), wanted.robot, restarts_window=True
        )

    def _grow(self, birth: BirthId) -> list[Record]:
        """Give a robot the best brain that it tried; it is an infant no longer."""
        infant, living = self._infants.pop(birth), self._found(birth)
        grown, _ = infant.learning.conclude()
        adult = grown.learnt or grown.robot
        living.is_infant = False
        living.individual = replace(
            living.individual, genome=grown.genome, learnt=grown.learnt
        )
        self._living.replace_brain(living, adult, restarts_window=True)
        return _rows(infant, adult)

    def _found(self, birth: BirthId) -> LivingRobot:
        living = self._living.get(birth)
        assert living is not None
        return living


def _asks(commands: Sequence[Evaluate | Ask]) -> list[Ask]:
    return [each for each in commands if isinstance(each, Ask)]


def _rows(infant: _Infant, adult: Robot | None = None) -> list[Record]:
    """Return the rows of the trials that have ended.

    The adult has the brain of the best trial; it is None if it did not grow up.
    """
    records = infant.learning.records()
    best = None if adult is None else encode_robot(adult)
    return [
        replace(
            record,
            row={
                **record.row,
                "sim_time_s": ended_s,
                "robot": best if trial == infant.learning.best else None,
            },
        )
        for trial, (record, ended_s) in enumerate(
            zip(records, infant.ended_s, strict=True)
        )
    ]
