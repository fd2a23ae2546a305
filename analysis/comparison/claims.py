"""Findings of the thesis as data: measure, experiments and direction.

Each finding is expressed by a measure; where the thesis does not define one, the choice
is that of this project, and the text names it. Source: Hupkes 2016, chapters 6 and 7.
"""

from dataclasses import dataclass
from typing import Any, Literal

Direction = Literal[">", "<", "=", "!=", "some"]


@dataclass(frozen=True, slots=True)
class Claim:
    """A finding of the thesis.

    Attributes:
        figure: figure of the thesis, or section.
        text: the finding in words.
        measure: column of ``outputs.OUTCOME``.
        a: an experiment.
        expected: relation of its runs to those of ``b``, or to ``reference``: "="
            means alike, "!=" different in either direction, "some" that the measure
            is above 0 in a run.
        b: another experiment; None compares ``a`` with ``reference``.
        reference: a number.
        margin: largest difference from ``reference`` that is negligible, in the
            measure's unit; with "=", the largest that counts as alike.
        share: factor of the values of ``b``.
        is_spread: compare the distances of the runs from their experiment's median,
            instead of the values.
        is_automatic: the finding follows almost by construction, or from the bodies or
            from reproduction alone, so that it also holds without selection.
        births: fewest births at which the finding means something.
        topic: the finding without the names of experiments.
    """

    figure: str
    text: str
    measure: str
    a: str
    expected: Direction
    b: str | None = None
    reference: float = 0.0
    margin: float = 0.0
    share: float = 1.0
    is_spread: bool = False
    is_automatic: bool = False
    births: int = 0
    topic: str = ""


_ONE, _TWO, _THREE = "scenario1", "scenario2", "scenario3"
_RANDOM, _DRIFT = "no-reproduction", "no-selection"
_EVOLVED = (_ONE, _TWO, _THREE)
ARENA, TOUCHES = "bench-arena", "scenario3-touches"
"""Names of a benchmark of arenas, and of scenario 3 with ``record_touches``."""

FLAT_BIRTHS, EARLY_BIRTHS, RETAINED_BIRTHS = 600, 300, 150
"""Fewest births: 20 broods in each half; a tenth that has a brood besides the founders;
populations 120 births apart."""

Pair = tuple[str, str]


def _of(
    figure: str,
    text: str,
    measure: str,
    expected: Direction,
    *pairs: Pair,
    **rest: Any,  # noqa: ANN401 - of a claim
) -> list[Claim]:
    """Return one claim per pair of experiments, with both names in the text."""
    topic = text.format(a="A", b="B")
    return [
        Claim(
            figure, text.format(a=a, b=b), measure, a, expected, b, topic=topic, **rest
        )
        for a, b in pairs
    ]


def _all(
    figure: str,
    text: str,
    measure: str,
    expected: Direction,
    reference: float = 0.0,
    *,
    of: tuple[str, ...] = _EVOLVED,
    **rest: Any,  # noqa: ANN401 - of a claim
) -> list[Claim]:
    """Return one claim per experiment that compares it with a number."""
    return [
        Claim(
            figure, f"{a}: {text}", measure, a, expected, reference=reference,
            topic=text, **rest,
        )
        for a in of
    ]  # fmt: skip


_TO_3 = ((_THREE, _ONE), (_THREE, _TWO))
_AMONG = ((_ONE, _TWO), (_ONE, _THREE), (_TWO, _THREE))
_OVER = tuple((a, b) for a in _EVOLVED for b in (_RANDOM, _DRIFT))


def _alike(figure: str, what: str, measure: str, *pairs: Pair) -> list[Claim]:
    """Return the claims that pairs of experiments have no large difference."""
    text = f"{what}: {{a}} and {{b}} differ by less than a large effect (0.474)"
    return _of(figure, text, measure, "=", *pairs)


def _sizes(figure: str, per_part: str, what: str, measure: str) -> list[Claim]:
    """Return the claims about a size: alike, over the baselines, alike per part."""
    divided = f"{measure}_per_part"
    return [
        *_alike(figure, what, measure, *_AMONG),
        *_of(figure, f"more {what} in {{a}} than in {{b}}", measure, ">", *_OVER),
        *_alike(per_part, f"{what} per part", divided, *_AMONG, *_OVER),
    ]  # fmt: skip


def _in_order(claims: list[Claim]) -> tuple[Claim, ...]:
    return tuple(
        sorted(claims, key=lambda claim: [int(n) for n in claim.figure.split(".")])
    )


CLAIMS: tuple[Claim, ...] = _in_order([
    *_of("6.2", "{a} ends fitter than {b}", "fitness", ">",
         (_ONE, _RANDOM), (_TWO, _RANDOM)),
    *_of("6.2", "{a} ends fitter than {b}", "fitness", ">",
         (_ONE, _DRIFT), (_TWO, _DRIFT), is_automatic=True),
    *_alike("6.2", "fitness at the end", "fitness", (_ONE, _TWO)),
    *_of("6.2", "the spread between runs differs between {a} and {b}", "fitness",
         "!=", (_TWO, _ONE), is_spread=True),
    *_of("6.2", "{a} ends less fit than {b}", "fitness", "<", *_TO_3),
    *_all("6.2", "fitness stays about zero (within 0.01 m/s)", "fitness", "=",
          margin=0.01, of=(_DRIFT,), is_automatic=True),
    *_of("6.2", "{a} gains less than a quarter of what {b} gains", "gain", "<",
         (_RANDOM, _ONE), (_RANDOM, _TWO), share=0.25),
    *_of("6.2.3", "the parts of the best robot's family come from fewer founders in "
         "{a} than in {b}", "family_founders", "<", (_TWO, _ONE), (_TWO, _THREE)),
    *_of("6.3", "a smaller share of the gain in fitness comes after half of the births "
         "in {a} than in {b}", "late_gain", "<", (_TWO, _ONE), *_TO_3,
         births=FLAT_BIRTHS),
    *_of("6.3", "fitness rises less in {a} than in {b} after half of the births",
         "late_rise", "<", (_TWO, _ONE), *_TO_3, births=FLAT_BIRTHS),
    *_alike("6.4", "ancestors per robot", "ancestors_per_robot", (_TWO, _ONE)),
    *_of("6.4", "more ancestors per robot in {a} than in {b}", "ancestors_per_robot",
         ">", *_TO_3),
    *_all("6.5", "diversity falls", "diversity_change", "<", margin=1.0),
    *_all("6.5", "more than a tenth of the loss of diversity happens in the first "
          "tenth of births", "early_drop", ">", 0.1, margin=0.05, births=EARLY_BIRTHS,
          is_automatic=True),
    *_of("6.5", "diversity falls faster in {a} than in {b}: mean over the first tenth "
         "of births", "early_diversity", "<", (_TWO, _ONE), births=EARLY_BIRTHS),
    *_of("6.5", "less diversity is left in {a} than in {b}", "diversity", "<",
         (_TWO, _ONE)),
    *_of("6.5", "more diversity is left in {a} than in {b}", "diversity", ">", *_TO_3),
    *_of("6.6", "rank is greater in {a} than in {b}", "rank", ">",
         (_TWO, _ONE), (_THREE, _TWO), (_THREE, _ONE)),
    *_of("6.7", "fewer stay for 120 births in {a} than in {b}", "retention", "<",
         *_TO_3, births=RETAINED_BIRTHS),
    *_all("6.7", "retention mirrors fitness: their rank correlation over births",
          "retention_fitness", ">", margin=0.1, births=EARLY_BIRTHS,
          is_automatic=True),
    *_all("6.8", "the range of a robot's fitness is more than a tenth of the range "
          "of its contemporaries", "variability", ">", 0.1, margin=0.05, of=(_THREE,),
          is_automatic=True),
    *_all("6.9", "robots outgrow random ones", "parts_change", ">", margin=1.0),
    *_all("6.9", "robots are as large as random ones (within 1 part)", "parts_change",
          "=", margin=1.0, of=(_DRIFT,)),
    *_of("6.9", "robots are larger in {a} than in {b}", "parts", ">", *_OVER),
    *_alike("6.9", "parts", "parts", *_AMONG),
    *_all("6.9", "larger robots are fitter (all robots of a run)", "parts_fitness",
          ">", margin=0.1, is_automatic=True),
    *_sizes("6.11", "6.12", "joints", "joints"),
    *_sizes("6.11", "6.12", "active joints", "active_joints"),
    *_sizes("6.11", "6.12", "passive joints", "passive_joints"),
    *_sizes("6.13", "6.13", "extremities", "extremities"),
    *_all("6.14", "more extremities, more fitness (all robots of a run)",
          "extremities_fitness", ">", margin=0.1, is_automatic=True),
    *_all("6.14", "from four extremities on fitness changes by less than 0.01 m/s per "
          "extremity (all robots of a run)", "extremities_slope", "=", margin=0.01,
          is_automatic=True),
    *_all("6.14", "more extremities per part, less fitness (all robots of a run)",
          "extremities_per_part_fitness", "<", margin=0.1, is_automatic=True),
    *_all("6.15", "most robots have no touch sensor", "without_touch", ">", 0.5,
          margin=0.05, of=(*_EVOLVED, _DRIFT)),
    *_all("6.15", "most robots have a touch sensor", "without_touch", "<", 0.5,
          margin=0.05, of=(_RANDOM,)),
    *_all("6.15", "fewer touch sensors than random robots have",
          "touch_sensors_change", "<", margin=0.15, of=(*_EVOLVED, _DRIFT)),
    *_all("6.15", "as many touch sensors as random robots have (within 0.3)",
          "touch_sensors_change", "=", margin=0.3, of=(_RANDOM,)),
    *_all("6.15", "robots without touch sensor occur", "without_touch", "some",
          is_automatic=True),
    *_all("6.15", "robots with one touch sensor occur", "one_touch", "some",
          is_automatic=True),
    *_all("6.15", "robots with two or more touch sensors occur", "two_touch", "some",
          is_automatic=True),
    *_all("6.16", "fewer hidden neurons than random robots have", "hidden_change", "<",
          margin=0.5, of=(*_EVOLVED, _DRIFT)),
    *_all("6.16", "as many hidden neurons as random robots have (within 1)",
          "hidden_change", "=", margin=1.0, of=(_RANDOM,)),
    *_alike("6.16", "hidden neurons per part", "hidden_per_part",
            (_ONE, _DRIFT), (_TWO, _DRIFT), (_THREE, _DRIFT)),
    *(claim for number, a in enumerate(_EVOLVED, 18) for claim in (
        *_all(f"6.{number}", "the best robot and ancestors of four levels differ less "
              "than half as much as founders", "family_distance", "<", 0.5,
              margin=0.05, of=(a,)),
        *_of(f"6.{number}", "the best robot and ancestors of four levels differ less "
             "in {a} than in {b}, relative to founders", "family_distance", "<",
             (a, _DRIFT)),
        *_all(f"6.{number}", "their parts come from less than a third of the 15 "
              "founders", "family_founders", "<", 5.0, margin=0.5, of=(a,),
              is_automatic=True))),
    *_all("7.1.2", "an arena of 28 random robots is simulated in real time (tested "
          "with 30)", "real_time_factor", ">", 1.0, margin=0.1, of=(ARENA,),
          is_automatic=True),
    *_all("7.2.1", "contact time per lifetime (simultaneous contacts count separately) "
          'is below 0.05 (our limit for "small")', "touching", "<", 0.05, margin=0.01,
          of=(TOUCHES,)),
    *_of("7.2.1", "in the windows after the selected one the best robot is fitter in "
         "{a} than in {b}", "later_fitness", ">", *_TO_3),
    *_of("7.2.1", "in these windows the best robot has a greater share of its fitness "
         "in {a} than in {b}", "sustained", ">", *_TO_3),
    *_of("7.2.1", "under changes of time step, friction and start the best robot keeps "
         "a greater share of its fitness in {a} than in {b}", "kept_fitness", ">",
         *_TO_3),
])  # fmt: skip
"""Findings in the order of the thesis's figures."""
