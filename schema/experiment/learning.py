"""The section ``[learning]``: lifetime learning of newborn robots."""

from typing import Annotated, Literal

from msgspec import Meta, field

from schema.experiment.section import Number, Parameters, PluginSection

LEARNERS = ("cma-es", "(1+1)-es", "random")
"""Built-in learners."""
MOST_TRIALS = 1000
"""Most trials of one newborn."""


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
            with; ``lamarckian``: its genome gets what it learnt.
        weight_limits: least and greatest weight; random weights of the built-in brain
            types are from 0 to 1. The range of a neuron's parameter is that of its
            type.
        parameters: parameters of the learner.
    """

    learner: str = "cma-es"
    budget: Annotated[int, Meta(ge=1, le=MOST_TRIALS)] = 20
    what: Literal["all", "weights", "neurons"] = "all"
    sigma: Annotated[float, Meta(gt=0, le=1)] = 0.2
    inherit: Literal["darwinian", "lamarckian"] = "darwinian"
    weight_limits: tuple[Number, Number] = (0.0, 1.0)
    parameters: Parameters = field(default_factory=dict)
