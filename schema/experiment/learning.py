"""The section ``[learning]``: lifetime learning of newborn robots."""

from typing import Annotated, Literal

from msgspec import Meta, field

from schema.experiment.section import Number, Parameters, PluginSection

LEARNERS = ("cma-es", "(1+1)-es", "random")
"""Built-in learners."""
MOST_TRIALS = 1000
"""Most trials of one newborn."""
PARENTS = 2
"""Parents whose best brains are samples."""


class Learning(PluginSection, frozen=True):
    """Lifetime learning: the brain of each newborn is tuned before it counts.

    A newborn is evaluated ``budget`` times. Trial 0 has the brain that develops from
    its genome; a learner proposes the parameters of the others. The robot keeps the
    brain of its best trial, and off-line that trial's fitness. In an arena each trial
    is a fitness window of the infant among the other robots.

    Attributes:
        learner: ``cma-es``, ``(1+1)-es``, ``random`` or ``module:attribute``.
        budget: trials of each newborn; 1 is no learning.
        what: what is learnt: ``weights`` of connections; parameters of ``neurons``,
            such as bias and gain, or period, phase and amplitude of an oscillator; or
            ``all`` of them.
        sigma: standard deviation of the learner's first steps, as a share of the range
            of each parameter; ``random`` ignores it.
        inherit: ``darwinian``: children inherit the genome that the robot was born
            with; ``lamarckian``: its genome gets what it learnt; ``samples``: as
            ``darwinian``, but the first trials of a child are the best brains of its
            parents, in its own body.
        peers: social learning: number of the fittest robots of the population whose
            brains are tried, too, before the learner begins at the best one.
        weight_limits: least and greatest weight; not given, the range of random
            weights: -2 to 2 of ``modular`` brains, 0 to 1 of others. The range of a
            neuron's parameter is that of its type.
        parameters: parameters of the learner.
    """

    learner: str = "cma-es"
    budget: Annotated[int, Meta(ge=1, le=MOST_TRIALS)] = 20
    what: Literal["all", "weights", "neurons"] = "all"
    sigma: Annotated[float, Meta(gt=0, le=1)] = 0.2
    inherit: Literal["darwinian", "lamarckian", "samples"] = "darwinian"
    peers: Annotated[int, Meta(ge=0, lt=MOST_TRIALS)] = 0
    weight_limits: tuple[Number, Number] | None = None
    parameters: Parameters = field(default_factory=dict)

    @property
    def samples(self) -> int:
        """Greatest number of brains of others that a newborn tries first."""
        return self.peers + (PARENTS if self.inherit == "samples" else 0)
