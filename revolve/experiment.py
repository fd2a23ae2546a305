"""Experiments as the Python API has them."""

import json
from collections.abc import Mapping
from math import inf
from pathlib import Path
from typing import Any, Self

import msgspec

from schema.errors import ExperimentError
from schema.experiment.changes import settings_at
from schema.experiment.document import Experiment as Document
from schema.experiment.document import island_experiment
from schema.experiment.file import read_experiment, source_text
from schema.plugins.bounded import parse_toml

_GIVEN = "experiment"
"""Name of a text without a file, in messages."""


class Experiment:
    """All settings that can change a birth.

    ``Experiment.read("scenario1", births=600, selection={"children": 1})`` takes a
    shipped experiment or a TOML file and changes some of its keys;
    ``Experiment.from_toml(text)`` takes a text. Each key has a default; unknown keys
    and values outside their ranges raise ``ExperimentError``.
    """

    __slots__ = ("_document", "_islands")

    def __init__(
        self, document: Document, islands: list[dict[str, Any]] | None = None
    ) -> None:
        """Wrap a checked document; use ``read`` or ``from_toml`` instead.

        ``islands`` have the keys that they set themselves; None: those that differ.
        """
        self._document = document
        self._islands = _own_keys(self.settings) if islands is None else islands

    @classmethod
    def read(
        cls,
        source: str | Path,
        **changes: Any,  # noqa: ANN401 - of any key
    ) -> Self:
        """Return a shipped experiment, or one from a TOML file.

        Args:
            source: a name such as ``scenario1``, or a path that ends in ``.toml``.
            changes: values of keys; that of a section is a dict of some of its keys.

        Raises:
            ExperimentError: no such experiment or file, or an invalid document.
        """
        text, where = source_text(str(source))
        return cls._changed(parse_toml(text, where), where, changes)

    @classmethod
    def from_toml(cls, text: str, **changes: Any) -> Self:  # noqa: ANN401 - as above
        """Return the experiment of a TOML text; paths in it start here.

        Raises:
            ExperimentError: an invalid document.
        """
        return cls._changed(parse_toml(text, _GIVEN), _GIVEN, changes)

    def replace(self, **changes: Any) -> Self:  # noqa: ANN401 - as above
        """Return the experiment with other values of some keys.

        They hold on all islands that do not set them themselves, as in ``read``.

        Raises:
            ExperimentError: an unknown key, or a value that is not allowed.
        """
        return self._changed(self._tables(), _GIVEN, changes)

    @classmethod
    def _changed(
        cls, tables: dict[str, Any], where: str, changes: Mapping[str, Any]
    ) -> Self:
        merged = _merged(tables, changes)
        return cls(read_experiment(merged, where), merged.get("islands", []))

    def at(self, point: float, island: int = 0) -> Self:
        """Return an island's settings with the values at a point of ``changes``.

        Args:
            point: number of births off-line, simulated time of an arena [s]; >= 0.
            island: number of the island.

        Raises:
            ExperimentError: a point below 0, or no such island.
        """
        if not 0 <= point < inf:
            raise ExperimentError(f"point: must be >= 0 and finite, got {point}")
        try:
            own = island_experiment(self._document, island)
        except ValueError as error:
            raise ExperimentError(str(error)) from None
        return type(self)(settings_at(own, point))

    def _tables(self) -> dict[str, Any]:
        return {**self.settings, "islands": self._islands}

    @property
    def name(self) -> str:
        """Name, which names the run folder."""
        return self._document.name

    @property
    def births(self) -> int:
        """Number of births on each island."""
        return self._document.births

    @property
    def settings(self) -> dict[str, Any]:
        """All keys with their values, sections as dicts; keys without value left out.

        docs/experiments.md has their meaning.
        """
        settings = _without_none(msgspec.to_builtins(self._document))
        assert isinstance(settings, dict)
        return settings

    def to_toml(self) -> str:
        """Return the experiment as a TOML text with all keys, of islands their own."""
        lines = [f"{key} = {_toml(value)}" for key, value in self._tables().items()]
        return "\n".join([*lines, ""])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Experiment) and self._document == other._document

    def __hash__(self) -> int:
        return hash(self._document)

    def __repr__(self) -> str:
        return f"<Experiment {self.name}: {self.births} births>"


def document_of(experiment: Experiment | str | Path) -> Document:
    """Return the document of an experiment, or of its name or path.

    Raises:
        ExperimentError: no such experiment or file, or an invalid document.
    """
    if isinstance(experiment, Experiment):
        return experiment._document  # noqa: SLF001 - of the class beside
    return read_experiment(str(experiment))


def _own_keys(settings: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the tables of islands without the values that the document has, too."""
    return [
        {
            name: {k: v for k, v in own.items() if v != settings.get(name, {}).get(k)}
            if isinstance(own, dict)
            else own
            for name, own in island.items()
            if own != settings.get(name)
        }
        for island in settings["islands"]
    ]


def _merged(tables: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return tables with other values of some keys; None removes a key."""
    merged = dict(tables)
    for key, value in changes.items():
        known = merged.get(key)
        if value is None:
            merged.pop(key, None)
        elif isinstance(value, Mapping):
            merged[key] = _merged(known if isinstance(known, Mapping) else {}, value)
        else:
            merged[key] = list(value) if isinstance(value, tuple) else value
    return merged


def _without_none(value: Any) -> Any:  # noqa: ANN401 - any tree of plain values
    if isinstance(value, dict):
        rest = {key: each for key, each in value.items() if each is not None}
        return {key: _without_none(each) for key, each in rest.items()}
    if isinstance(value, list | tuple):
        return [_without_none(each) for each in value]
    return value


def _toml(value: Any) -> str:  # noqa: ANN401 - any tree of plain values
    if isinstance(value, dict):
        pairs = (f"{_toml(key)} = {_toml(each)}" for key, each in value.items())
        return f"{{{', '.join(pairs)}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, str):
        # The escapes of JSON are those of TOML, which also escapes this one.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return json.dumps(value)
