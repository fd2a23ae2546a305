"""Re-evaluation of living robots; durations of evaluations, and points of changes.

Physics is deterministic: a re-evaluation differs only if its duration differs or the
experiment has noise. The duration is drawn for each trial of each robot from its own
stream.
Source: Hupkes 2016, section 8.2, on scenarios between his 2 and 3.
"""

from collections.abc import Iterable, Sequence
from math import fsum

from msgspec.structs import replace

from coordinator.evolution.breeding import Individual
from coordinator.evolution.encodings import encoding_of
from coordinator.evolution.random_streams import BufferedRng, Purpose, stream
from coordinator.islands.events import IslandCommand, Outcome, Record
from coordinator.islands.rows import evaluation_record
from schema.errors import UnexpectedEvent
from schema.experiment.document import Experiment, Simulation, steps_of
from schema.robot.ids import BirthId
from schema.robot.results import failed_fitness
from schema.wire.messages import Evaluate


def with_durations(
    commands: Iterable[IslandCommand], simulation: Simulation, seed: int, run: int
) -> list[IslandCommand]:
    """Return commands with random durations of evaluation, uniform in their range."""
    assert simulation.evaluation_s is not None
    shortest, longest = (steps_of(end, simulation) for end in simulation.evaluation_s)

    def timed(each: Evaluate) -> Evaluate:
        rng = stream(seed, run, each.birth, each.trial, Purpose.DURATION)
        steps = shortest + BufferedRng(rng).below(longest - shortest + 1)
        return replace(each, steps=steps)

    return [timed(each) if isinstance(each, Evaluate) else each for each in commands]


def with_points(
    commands: Iterable[IslandCommand], births: int, *, learns: bool
) -> list[IslandCommand]:
    """Return commands with the points at which robots meet changing settings.

    That of a newborn is its number, also in the trials in which it learns; that of a
    re-evaluation are the births of the island so far.
    """

    def pointed(each: Evaluate) -> Evaluate:
        is_newborn = each.requester is None and (learns or not each.trial)
        return replace(each, point=each.birth.number if is_newborn else births)

    return [pointed(each) if isinstance(each, Evaluate) else each for each in commands]


class Reevaluations:
    """Re-evaluations of the robots of one island."""

    def __init__(self, experiment: Experiment, island: int) -> None:
        rules = experiment.selection.reevaluation
        assert rules is not None
        self._rules = rules
        self._labels = experiment.measures.labels
        self._develop = encoding_of(experiment).robot_of
        self._island = island
        self._founders = experiment.selection.population
        self._due_births = self._founders + rules.interval
        # Fitness of each trial, and number of births at the last re-evaluation.
        self._trials: dict[BirthId, list[float | None]] = {}
        self._last_births: dict[BirthId, int] = {}
        self._outcomes: dict[BirthId, Outcome | None] = {}

    @property
    def is_open(self) -> bool:
        """A re-evaluation has no outcome yet."""
        return None in self._outcomes.values()

    def start(self, births: int, population: Sequence[Individual]) -> list[Evaluate]:
        """Return the re-evaluations that are due; each number of births counts once.

        The population are the parents of the last brood. Immigrants among them keep the
        fitness that they arrived with.
        """
        if births < self._due_births:
            return []
        self._due_births = births + self._rules.interval
        self._due_births -= (births - self._founders) % self._rules.interval
        natives = [one for one in population if one.birth.island == self._island]
        count = max(1, round(self._rules.share * len(natives)))
        chosen = sorted(natives, key=self._last_evaluation)[:count]
        commands = []
        for one in sorted(chosen, key=lambda one: one.birth):
            trials = self._trials.setdefault(one.birth, [one.known_fitness])
            self._last_births[one.birth] = births
            self._outcomes[one.birth] = None
            robot = self._develop(one.genome)
            commands.append(Evaluate(one.birth, robot, len(trials)))
        return commands

    def take(self, outcome: Outcome) -> None:
        """Store the outcome of a re-evaluation; duplicates are ignored.

        Raises:
            UnexpectedEvent: no such re-evaluation is open.
        """
        birth = outcome.birth
        trials = len(self._trials.get(birth, ()))
        if outcome.trial < trials:
            return
        if birth not in self._outcomes or outcome.trial > trials:
            raise UnexpectedEvent(
                f"island {self._island}: {sorted(self._outcomes)} are re-evaluated, "
                f"{birth} has {trials} trials, got {outcome}"
            )
        if self._outcomes[birth] is None:
            self._outcomes[birth] = outcome

    def conclude(
        self, population: Sequence[Individual]
    ) -> tuple[tuple[Individual, ...], list[Record]]:
        """Return the population with its new fitness, and the rows of the trials."""
        outcomes, self._outcomes = self._outcomes, {}
        records = []
        for birth, outcome in outcomes.items():
            assert outcome is not None
            found = outcome.evaluation
            self._trials[birth].append(found.fitness if found else None)
            records.append(evaluation_record(outcome, self._labels))
        evaluated = (
            self._evaluated(one, outcome)
            if (outcome := outcomes.get(one.birth))
            else one
            for one in population
        )
        return tuple(evaluated), records

    def _evaluated(self, individual: Individual, outcome: Outcome) -> Individual:
        """Return an individual with the fitness that follows from its trials."""
        evaluated = individual.evaluated(outcome.evaluation, self._labels)
        trials = self._trials[individual.birth]
        if self._rules.fitness == "replace":
            trials = trials[-1:]
        if all(each is None for each in trials):
            return evaluated
        failed = failed_fitness(each for each in trials if each is not None)
        fitness = fsum(failed if each is None else each for each in trials)
        fitness /= len(trials)
        return replace(evaluated, fitness=fitness, has_failed=False)

    def _last_evaluation(self, individual: Individual) -> tuple[int, BirthId]:
        """Return the number of births at the last evaluation, and the id for ties."""
        birth = individual.birth
        return self._last_births.get(birth, birth.number + 1), birth
