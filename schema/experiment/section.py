"""Base classes and number types of the sections of an experiment."""

from collections.abc import Iterator
from math import isclose
from typing import Annotated, Any

from msgspec import Meta, Struct, json

from schema.limits import MOST_COUNT, MOST_LENGTH_M

Probability = Annotated[float, Meta(ge=0, le=1)]
Number = Annotated[float, Meta(ge=-1e12, le=1e12)]
Positive = Annotated[float, Meta(gt=0, le=1e12)]
NotNegative = Annotated[float, Meta(ge=0, le=1e12)]
Limit = Annotated[float, Meta(gt=0, le=1e300)]
"""A limit that a great number switches off."""
Length = Annotated[float, Meta(ge=0, le=MOST_LENGTH_M)]
Extent = Annotated[float, Meta(gt=0, le=MOST_LENGTH_M)]
Coordinate = Annotated[float, Meta(ge=-MOST_LENGTH_M, le=MOST_LENGTH_M)]
Place = tuple[Coordinate, Coordinate, Coordinate]
Angle = Annotated[float, Meta(ge=-3600, le=3600)]
Value = Annotated[int, Meta(ge=-MOST_COUNT, le=MOST_COUNT)] | Number
Count = Annotated[int, Meta(ge=0, le=MOST_COUNT)]
AtLeastOne = Annotated[int, Meta(ge=1, le=10**9)]
Index = Annotated[int, Meta(ge=0, le=10**9)]
"""Number of an island or of a birth, from 0."""
Size = Annotated[int, Meta(ge=1, le=10**6)]
"""Number of things that exist at the same time."""


class Section(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of the sections: immutable, without unknown keys, keyword-only."""


Parameters = dict[str, Any]
"""Parameters of a plug-in; ``schema.plugins.parameters`` reads them."""


class PluginSection(Section, frozen=True):
    """Base of the sections with parameters of plug-ins, which are not changed."""

    def __hash__(self) -> int:
        """Return a hash of the section's text: a dict has none."""
        return hash(json.encode(self, order="deterministic"))


def multiple_problems(key: str, value: float, unit: float, what: str) -> Iterator[str]:
    """Yield whether the value of a key is no whole multiple of a unit."""
    if not isclose(round(value / unit) * unit, value, rel_tol=1e-9):
        yield f"{key}: must be a whole multiple of {unit:g}, {what}, got {value:g}"
