"""Parsers of the commands, for completion and documentation."""

import argparse
from importlib import import_module

from revolve.cli.commands import COMMANDS
from schema.agent.flags import Flags


def parser_of(command: str) -> Flags:
    """Return the parser of a command."""
    parser: Flags = import_module(COMMANDS[command][0]).parser(command)
    return parser


def subparsers_of(
    parser: argparse.ArgumentParser,
) -> "argparse._SubParsersAction[Flags] | None":
    """Return what holds the actions of a parser; None if it has none."""
    for action in parser._actions:  # noqa: SLF001 - argparse has no public access
        if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001 - the same
            return action
    return None


def actions(parser: Flags) -> dict[str, Flags]:
    """Return the parsers of a command's actions, such as ``list`` of ``arena``."""
    found = subparsers_of(parser)
    return {} if found is None else dict(found.choices)
