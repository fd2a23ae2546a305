"""The pages that are generated from the code agree with it, and miss nothing."""

import argparse
import re
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

import revolve
from docs import messages_reference, python_reference, settings_reference
from docs.reference_pages import PAGES
from docs.struct_tables import attributes, rows
from revolve.cli.commands import COMMANDS, parser_of
from schema.experiment.document import ArenaWorld, Experiment
from schema.experiment.section import PluginSection, Section
from schema.experiment.settings import (
    Ablation,
    ArenaSettings,
    EvaluationSettings,
)
from schema.tables.columns import TABLES

TOP = Path(__file__).parents[2]


def _page(name: str) -> str:
    return (TOP / "docs" / "reference" / name).read_text("utf-8")


EVERY = PAGES | {python_reference.PAGE: python_reference.reference}


@pytest.mark.parametrize("file", EVERY, ids=lambda file: file.name)
def test_page_is_up_to_date(file: Path) -> None:
    assert file.read_text("utf-8") == EVERY[file](), (
        "run python -m docs.reference_pages"
    )


_INNER = ("Origin", "Range")
"""Values of keys, which the descriptions of these keys explain."""


def _sections(base: type[Section] = Section) -> Iterator[type[Section]]:
    """Yield the sections that users write; the others are parts of requests."""
    others = (
        PluginSection, ArenaWorld, EvaluationSettings, ArenaSettings,
        Ablation,
    )  # fmt: skip
    for found in base.__subclasses__():
        in_document = found.__module__.startswith("schema.experiment.")
        if in_document and found not in others and found.__name__ not in _INNER:
            yield found
        yield from _sections(found)


def test_every_key_of_every_section_is_listed() -> None:
    parts = re.split(r"^## ", _page("settings.md"), flags=re.MULTILINE)
    names = settings_reference.sections().values()
    assert {"", "space", "selection.culling", "islands", "migration"} <= {*names}
    sections = [*_sections()]
    assert Experiment in sections
    for section in sections:
        place = f"In the code: `{section.__name__}`"
        (part,) = (part for part in parts if place in part)
        listed = re.findall(r"^\| `(\w+)` \|", part, re.MULTILINE)
        assert listed == [*section.__struct_encode_fields__]
        meanings = re.findall(r"^\| `\w+` \|.* \| (.*) \|$", part, re.MULTILINE)
        assert len(set(meanings)) == len(listed), "keys with the same description"


def _flags(parser: argparse.ArgumentParser) -> set[str]:
    """Return the flags in the help of a parser and of its subcommands."""
    found = set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", parser.format_usage()))
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                found |= _flags(inner)
    return found


def test_every_flag_of_every_command_is_listed() -> None:
    page = _page("commands.md")
    parts = re.split(r"^## ", page, flags=re.MULTILINE)
    for name in COMMANDS:
        (part,) = (part for part in parts if part.startswith(f"`revolve {name}`\n"))
        flags = {flag for flag in _flags(parser_of(name)) if flag != "--help"}
        listed = set(re.findall(r"^\| `(?:-\w, )?(--[a-z-]+)", part, re.MULTILINE))
        assert listed == flags, name
    row = "| `--births N` | the experiment's | number of births |"
    assert row in page.splitlines()
    assert "| `--place X Y` |" in page  # two values, as usage shows them


def test_every_column_of_every_table_is_listed() -> None:
    parts = re.split(r"^## ", _page("columns.md"), flags=re.MULTILINE)
    for name, schema in TABLES.items():
        (part,) = (part for part in parts if part.startswith(f"`{name}`\n"))
        listed = re.findall(r"^\| `(\w+)` \| (\S.*?) \|", part, re.MULTILINE)
        assert [column for column, _ in listed] == schema.names
        for field in schema:
            assert dict(listed)[field.name].endswith(", null") == field.nullable
    row = "`z` | float32 | m | z of the centre of the core, world frame, z up"
    assert f"| {row} |" in _page("columns.md").splitlines()


def test_every_field_of_every_protobuf_message_is_listed() -> None:
    page = _page("messages.md")
    source = (TOP / "schema" / "wire" / "revolve.proto").read_text("utf-8")
    messages = re.findall(
        r"^message (\w+) \{\n(.*?)^\}", source, re.MULTILINE | re.DOTALL
    )
    assert len(messages) >= 8
    page = page.partition("## Protobuf messages\n")[2]
    for name, body in messages:
        part = page.split(f"### `{name}`\n", 1)[1].split("\n###")[0]
        fields = re.findall(r"^\s*[^/\n]*?(\w+) = (\d+);", body, re.MULTILINE)
        listed = re.findall(r"^\| (\d+) \| `(\w+)` \|", part, re.MULTILINE)
        assert listed == [(number, field) for field, number in fields], name


def test_every_key_and_messagepack_message_is_listed() -> None:
    page = _page("messages.md")
    for key in (
        "w/NAME/jobs",
        "an/NAME/jobs",
        "co/NAME/command",
        "w/NAME/arena/SHARD/pose",
    ):
        assert f"| `revolve/FLEET/{key}` |" in page
    listed = messages_reference.messagepack()
    assert {"Request", "Advance", "OperatorReply", "Update", "Report"} <= {*listed}
    for name in listed:
        assert f"### `{name}`\n" in page


def test_a_field_without_a_description_is_an_error() -> None:
    class Bare(msgspec.Struct):
        """Something.

        Attributes:
            first, second: numbers
                of two lines [m].
        """

        first: float
        second: float
        third: int = 0

    assert attributes(Bare) == dict.fromkeys(
        ("first", "second"), "numbers of two lines [m]."
    )
    with pytest.raises(ValueError, match=r"^Bare\.third: has no description$"):
        list(rows(Bare, lambda kind: kind.__name__))


def test_every_public_name_has_an_entry() -> None:
    lines = python_reference.reference().splitlines()
    titles = [line for line in lines if line.startswith("### ")]
    inner = [f"### `gym.{name}`" for name in ("RobotEnv", "make")]
    names = [f"### `{name}`" for name in dir(revolve)]
    assert sorted(titles) == sorted(names + inner)
