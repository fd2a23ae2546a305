"""Text of docs/reference/commands.md: every command and flag, from the parsers."""

import argparse
import re
from collections.abc import Iterator
from typing import Any

from revolve.cli.commands import COMMANDS, actions, parser_of
from schema.agent.flags import Flags

_HEAD = """# Commands

Written from the code by `python -m docs.reference_pages`. `revolve COMMAND --help`
shows the same.

Of all flags only those that say what to run change births: experiment, `--seed`,
`--births`, and `--allow-drift`, which a run records. Other settings that change births
are [keys of the experiment](settings.md).

| command | what it does |
|---|---|
"""
_OF_MACHINE = {("revolve worker", "processes"): "number of cores"}
"""Defaults that differ between machines."""
_DEFAULT = re.compile(r"(?:\s*\(|; )default: (.*?)\)?$")


def page() -> str:
    """Return the page."""
    rows = [line for name in COMMANDS for line in _overview(name)]
    texts = [line for name in COMMANDS for line in _command(name)]
    return _HEAD + "\n".join([*rows, "", *texts]).rstrip() + "\n"


def _overview(name: str) -> Iterator[str]:
    """Yield the table rows of a command and of its actions."""
    inner = actions(parser_of(name)).items()
    texts = {f"{name} {word}": parser.description or "" for word, parser in inner}
    for full, text in {name: COMMANDS[name][1], **texts}.items():
        what = text.partition(". ")[0].removesuffix(".")
        what = f"{what[:1].lower()}{what[1:]}"
        yield f"| [`revolve {full}`](#revolve-{full.replace(' ', '-')}) | {what} |"


def _command(name: str) -> Iterator[str]:
    """Yield the lines about a command."""
    yield f"## `revolve {name}`\n"
    yield from _parser(parser_of(name), f"revolve {name}", 3)


def _parser(parser: Flags, name: str, level: int) -> Iterator[str]:
    """Yield the lines about a parser and those of its subcommands."""
    if parser.description:
        yield f"{_sentence(parser.description)}\n"
    rows = [_row(action, parser) for action in arguments(parser)]
    if rows:
        yield from ("| argument | default | meaning |", "|---|---|---|", *rows, "")
    yield from ("```", *parser.examples, "```", "")
    for word, inner in actions(parser).items():
        yield f"{'#' * level} `{name} {word}`\n"
        yield from _parser(inner, f"{name} {word}", level + 1)


def arguments(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """Return the arguments of a parser that its help shows, without ``--help``."""
    return [
        action
        for action in parser._actions  # noqa: SLF001 - argparse has no public list
        if action.help is not argparse.SUPPRESS
        and not isinstance(action, argparse._HelpAction | argparse._SubParsersAction)  # noqa: SLF001
    ]


def _row(action: argparse.Action, parser: argparse.ArgumentParser) -> str:
    """Return the line of an argument."""
    of_machine = _OF_MACHINE.get((parser.prog, action.dest))
    shown = vars(action) | {"prog": parser.prog}
    if action.choices is not None:
        shown["choices"] = ", ".join(map(str, action.choices))
    meaning = (action.help or "") % shown
    default = _DEFAULT.search(meaning)
    cells = (
        f"`{_name(action)}`",
        of_machine or (default[1] if default else _default(action)),
        _DEFAULT.sub("", meaning),
    )
    return f"| {' | '.join(_cell(each) for each in cells)} |"


def _name(action: argparse.Action) -> str:
    """Return an argument as usage shows it."""
    choices: Any = action.choices
    words = action.metavar or action.dest
    if isinstance(words, tuple):
        words = " ".join(words)
    value = "|".join(map(str, choices)) if choices else words
    if action.nargs in ("+", "*"):
        value += " ..."
    if not action.option_strings:
        return value
    names = ", ".join(action.option_strings)
    if not (choices or action.metavar):
        value = value.upper()
    return names if action.nargs == 0 else f"{names} {value}"


def _default(action: argparse.Action) -> str:
    """Return the default of an argument whose help does not name it."""
    if not action.option_strings:
        return "required" if action.required else ""
    if action.required:
        return "required"
    if action.nargs == 0:
        return "off"
    return (
        "not given"
        if action.default in (None, argparse.SUPPRESS, [], ())
        else f"{action.default}"
    )


def _cell(text: str) -> str:
    """Return a text as Markdown has it in a cell; signs in code stay as they are."""
    return text.replace("|", "\\|") if "`" in text else _plain(text)


def _plain(text: str) -> str:
    """Return a text in which no sign has a meaning in Markdown."""
    return re.sub(r"([|*<\[])", r"\\\1", text)


def _sentence(text: str) -> str:
    """Return a description as one line that begins with a capital letter."""
    line = _plain(" ".join(text.split()))
    return line[:1].upper() + line[1:]
