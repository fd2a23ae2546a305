"""Base classes and number types of the sections of an experiment."""

from typing import Annotated, Any

from msgspec import Meta, Struct, json

from schema.limits import MOST_COUNT

Probability = Annotated[float, Meta(ge=0, le=1)]
Positive = Annotated[float, Meta(gt=0)]
NotNegative = Annotated[float, Meta(ge=0)]
Count = Annotated[int, Meta(ge=0, le=MOST_COUNT)]
AtLeastOne = Annotated[int, Meta(ge=1, le=MOST_COUNT)]


class Section(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of the sections: immutable, without unknown keys, keyword-only."""


Parameters = dict[str, Any]
"""Parameters of a plug-in; ``schema.plugins.parameters`` reads them."""


class PluginSection(Section, frozen=True):
    """Base of the sections with parameters of plug-ins, which are not changed."""

    def __hash__(self) -> int:
        """Return a hash of the section's text: a dict has none."""
        return hash(json.encode(self, order="deterministic"))
