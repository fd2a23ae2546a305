"""Evaluations that last a time of their own, and the living who are judged anew.

Physics repeats: a robot that is judged anew does otherwise only where its evaluation
lasts another time, or where there is noise. How long is drawn for each trial of each
robot by its name.
Source: Hupkes 2016, section 8.2, on what may lie between his scenarios 2 and 3.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import fsum, isfinite

from coordinator.evolution.random_streams import BufferedRng, Purpose, stream
from coordinator.evolution.selection import Individual
from coordinator.islands.events import Evaluate, Evaluated, EvaluationFailed, Record
from coordinator.islands.rows import evaluation_record
from coordinator.islands.survival import EveryNBirths
from schema.errors import UnexpectedEvent
from schema.experiment.document import Experiment, body_space, steps_of
from schema.robot.genome import develop
from schema.robot.ids import BirthId

Outcome = Evaluated | EvaluationFailed


@dataclass(slots=True)
class _Past:
    """How an individual was judged so far.

    Attributes:
        births: how many had been when it was judged last.
        fitness: of each trial, None where it failed.
    """

    births: int
    fitness: list[float | None] = field(default_factory=list)


class Reevaluations:
    """Asks for the evaluations of one island's robots, the first and all others."""

    def __init__(
        self, experiment: Experiment, seed: int, run: int, number: int
    ) -> None:
        """Have judged nobody.

        Args:
            experiment: the island's.
            seed: of the experiment's execution.
            run: number of the repeat, from 0.
            number: of the island.
        """
        self._clock = experiment.simulation
        self._space = body_space(experiment.space)
        self._seed, self._run, self._number = seed, run, number
        self._rules = experiment.selection.reevaluation
        interval = self._rules.interval if self._rules else experiment.births
        self._every = EveryNBirths(interval, experiment.selection.population)
        self._past: dict[BirthId, _Past] = {}
        self._asked: dict[BirthId, Outcome | None] = {}

    @property
    def is_open(self) -> bool:
        """Somebody is being judged anew."""
        return any(outcome is None for outcome in self._asked.values())

    def timed(self, command: Evaluate) -> Evaluate:
        """Return a question that says how long the robot shall be simulated."""
        if self._clock.evaluation_s is None:
            return command
        ends = (steps_of(end, self._clock) for end in self._clock.evaluation_s)
        shortest, longest = ends
        birth, trial = command.birth, command.trial
        rng = stream(self._seed, self._run, birth, trial, Purpose.DURATION)
        steps = shortest + BufferedRng(rng).below(longest - shortest + 1)
        return replace(command, steps=steps)

    def ask_anew(self, births: int, population: Sequence[Individual]) -> list[Evaluate]:
        """Return whose judgement is to be repeated now; nobody's if it is not time.

        Args:
            births: how many have been; each number is asked about once.
            population: those who were judged before the brood that has just been.
                Immigrants among them stay with the judgement that they came with.
        """
        if not (self._rules and self._every.is_due_at(births)):
            return []
        born_here = [one for one in population if one.birth.island == self._number]
        count = max(1, round(self._rules.share * len(born_here)))
        chosen = sorted(born_here, key=self._judged_at)[:count]
        asked = []
        for one in sorted(chosen, key=lambda one: one.birth):
            past = self._past.setdefault(one.birth, _Past(0, [_known(one)]))
            past.births = births
            self._asked[one.birth] = None
            robot = develop(one.genome, self._space)
            asked.append(self.timed(Evaluate(one.birth, robot, len(past.fitness))))
        return asked

    def take(self, outcome: Outcome) -> None:
        """Keep how somebody did anew, unless that is known.

        Raises:
            UnexpectedEvent: nobody asked, or the fitness is no number.
        """
        birth, past = outcome.birth, self._past.get(outcome.birth)
        reevaluations = len(past.fitness) if past else 0
        if outcome.trial < reevaluations:
            return
        if birth not in self._asked or outcome.trial > reevaluations:
            raise UnexpectedEvent(
                f"island {self._number}: {sorted(self._asked)} are judged anew, of "
                f"{birth} {reevaluations} trials have been, got {outcome}"
            )
        if isinstance(outcome, Evaluated) and not isfinite(outcome.evaluation.fitness):
            raise UnexpectedEvent(f"fitness must be finite, got {outcome}")
        if self._asked[birth] is None:
            self._asked[birth] = outcome

    def conclude(
        self, population: Sequence[Individual]
    ) -> tuple[tuple[Individual, ...], list[Record]]:
        """Return the population as it was judged last, and the rows of its trials."""
        asked, self._asked = self._asked, {}
        records = []
        for birth in sorted(asked):
            outcome = asked[birth]
            if outcome is not None:
                self._past[birth].fitness.append(_fitness(outcome))
                records.append(evaluation_record(outcome))
        judged = (
            self._judged(one) if one.birth in asked else one for one in population
        )
        return tuple(judged), records

    def _judged(self, individual: Individual) -> Individual:
        """Return an individual with the fitness that all of its trials come to."""
        reevaluations = self._past[individual.birth].fitness
        if self._rules is None or self._rules.fitness == "replace":
            reevaluations = reevaluations[-1:]
        value = fsum(each or 0.0 for each in reevaluations) / len(reevaluations)
        has_failed = all(each is None for each in reevaluations)
        return replace(individual, fitness=value, has_failed=has_failed)

    def _judged_at(self, individual: Individual) -> tuple[int, BirthId]:
        """Return when somebody was judged last, and the name, for ties."""
        birth = individual.birth
        past = self._past.get(birth)
        return past.births if past else birth.number + 1, birth


def _known(individual: Individual) -> float | None:
    return None if individual.has_failed else individual.fitness


def _fitness(outcome: Outcome) -> float | None:
    return outcome.evaluation.fitness if isinstance(outcome, Evaluated) else None
