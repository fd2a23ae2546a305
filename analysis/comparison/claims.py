"""Findings of the thesis as data: measure, experiments and direction.

Each finding is expressed by a measure; where the thesis does not define one, the choice
is that of this project, and the text names it. Source: Hupkes 2016, chapter 6.
"""

from dataclasses import dataclass
from typing import Literal

Direction = Literal[">", "<", "="]


@dataclass(frozen=True, slots=True)
class Claim:
    """A finding of the thesis.

    Attributes:
        figure: figure of the thesis.
        text: the finding in words.
        measure: column of ``outputs.OUTCOME``.
        a: an experiment.
        expected: relation of its runs to those of ``b``, or to ``reference``; "="
            means no large difference.
        b: another experiment; None compares ``a`` with ``reference``.
        reference: a number.
    """

    figure: str
    text: str
    measure: str
    a: str
    expected: Direction
    b: str | None = None
    reference: float = 0.0


_ONE, _TWO, _THREE = "scenario1", "scenario2", "scenario3"
_RANDOM, _DRIFT = "no-reproduction", "no-selection"
_EVOLVED = (_ONE, _TWO, _THREE)


Pair = tuple[str, str]


def _of(
    figure: str, text: str, measure: str, expected: Direction, *pairs: Pair
) -> list[Claim]:
    """Return one claim per pair of experiments, with both names in the text."""
    return [
        Claim(figure, text.format(a=a, b=b), measure, a, expected, b) for a, b in pairs
    ]


def _all(
    figure: str, text: str, measure: str, expected: Direction, reference: float = 0.0
) -> list[Claim]:
    """Return one claim per scenario that compares it with a number."""
    return [
        Claim(figure, f"{a}: {text}", measure, a, expected, reference=reference)
        for a in _EVOLVED
    ]


_TO_3 = ((_THREE, _ONE), (_THREE, _TWO))

CLAIMS: tuple[Claim, ...] = (
    *_of("6.2", "{a} ends fitter than {b}", "fitness", ">",
         (_ONE, _RANDOM), (_ONE, _DRIFT), (_TWO, _RANDOM), (_TWO, _DRIFT)),
    *_of("6.2", "{a} and {b} end alike", "fitness", "=", (_ONE, _TWO)),
    *_of("6.2", "{a} ends less fit than {b}", "fitness", "<", *_TO_3),
    *_of("6.3", "fitness levels off earlier in {a} than in {b}", "late_gain", "<",
         (_TWO, _ONE), *_TO_3),
    *_of("6.4", "as many ancestors per robot in {a} as in {b}", "ancestors_per_robot",
         "=", (_TWO, _ONE)),
    *_of("6.4", "more ancestors per robot in {a} than in {b}", "ancestors_per_robot",
         ">", *_TO_3),
    *_all("6.5", "diversity falls", "diversity_change", "<"),
    *_all("6.5", "early: the first tenth of births takes more than a tenth of it",
          "early_drop", ">", 0.1),
    *_of("6.5", "less diversity is left in {a} than in {b}", "diversity", "<",
         (_TWO, _ONE)),
    *_of("6.5", "more diversity is left in {a} than in {b}", "diversity", ">", *_TO_3),
    *_of("6.6", "rank is greater in {a} than in {b}", "rank", ">",
         (_TWO, _ONE), (_THREE, _TWO)),
    *_of("6.7", "fewer stay for 120 births in {a} than in {b}", "retention", "<",
         *_TO_3),
    Claim("6.8", "a robot's fitness ranges over more than a tenth of its "
          "contemporaries'", "variability", _THREE, ">", reference=0.1),
    *_all("6.9", "robots outgrow random ones", "parts_change", ">"),
    *_of("6.9", "robots are larger in {a} than in {b}", "parts", ">",
         (_ONE, _RANDOM), (_ONE, _DRIFT)),
    *_of("6.12", "as many joints per part in {a} as in {b}", "joints_per_part", "=",
         (_ONE, _TWO), (_ONE, _THREE), (_TWO, _THREE)),
    *_all("6.14", "more extremities, more fitness", "extremities_fitness", ">"),
    *_all("6.14", "more extremities per part, less fitness",
          "extremities_per_part_fitness", "<"),
    *_all("6.15", "most robots have no touch sensor", "without_touch", ">", 0.5),
    *_all("6.15", "fewer touch sensors than random robots have",
          "touch_sensors_change", "<"),
    *_all("6.16", "fewer hidden neurons than random robots have", "hidden_change", "<"),
    Claim("6.16", "no-selection: fewer hidden neurons than random robots have",
          "hidden_change", _DRIFT, "<"),
    *_of("6.16", "as many hidden neurons in {a} as in {b}", "hidden", "=",
         (_ONE, _DRIFT)),
)  # fmt: skip
"""Findings in the order of the thesis's figures."""
