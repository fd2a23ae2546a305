"""The commands of `revolve`: their modules, summaries and parsers."""

import argparse
from importlib import import_module
from typing import Any

_COORDINATOR = "coordinator.__main__"
COMMANDS = {
    "run": (_COORDINATOR, "evolve experiments on this machine"),
    "resume": (_COORDINATOR, "resume a run or campaign after a stop or crash"),
    "coordinator": (_COORDINATOR, "run experiments for remote workers"),
    "hub": ("coordinator.cli.hub", "connect coordinators, workers and viewers"),
    "cluster": ("coordinator.cluster.command", "make certificates for a lab"),
    "doctor": ("coordinator.doctor.command", "check this machine and its fleet"),
    "status": ("coordinator.cli.status", "show the progress of runs"),
    "log": ("coordinator.cli.log", "print the journal of a run"),
    "arena": ("coordinator.cli.arena", "inspect and control a running arena"),
    "compare": (_COORDINATOR, "compare two runs or campaigns that should be equal"),
    "join": ("coordinator.cli.join", "make one run of groups of islands"),
    "plugins": (_COORDINATOR, "list plug-ins, built-in or found"),
    "check": (_COORDINATOR, "check plug-ins as a run does"),
    "worker": ("worker.__main__", "simulate robots for a coordinator"),
    "analyzer": ("analyzer.__main__", "breed and vet robots for a coordinator"),
    "robot": ("schema.__main__", "check, convert or show a robot file"),
    "robot pack": ("revolve.cli.pack", "write a robot and its settings to one file"),
    "robot page": ("analysis.__main__", "write robots to a page that plays them"),
    "robot random": ("revolve.cli.random_robots", "generate random robots"),
    "robot render": ("analysis.__main__", "render a robot as picture or film"),
    "robot simulate": ("worker.robot_command", "simulate a robot and show its fitness"),
    "view": ("analysis.__main__", "view a run, live or from its tables"),
    "analyze": ("analysis.__main__", "compute measures, figures and a report"),
    "export": ("revolve.cli.export", "write the tables of all runs to one file"),
    "robustness": ("revolve.cli.reevaluate", "re-evaluate a run under changes"),
    "ablate": ("revolve.cli.reevaluate", "re-evaluate a run without sensors or motors"),
    "suite": ("revolve.suite.command", "score experiments by a frozen protocol"),
    "completion": ("revolve.cli.completion", "print a completion script for a shell"),
    "bench": ("worker.__main__", "benchmark this machine"),
}
"""Module and summary of each command.

The module's ``main`` gets the arguments, the command's name first; its ``parser``
returns the parser of the command with that name. Names of two words take precedence
over their first word; ``main`` gets them as one argument.
"""


def parser_of(command: str) -> Any:  # noqa: ANN401 - its module is costly to import
    """Return the parser of a command, a ``schema.agent.flags.Flags``."""
    return import_module(COMMANDS[command][0]).parser(command)


def subparsers_of(parser: argparse.ArgumentParser) -> Any:  # noqa: ANN401 - as above
    """Return what holds the actions of a parser; None if it has none."""
    for action in parser._actions:  # noqa: SLF001 - argparse has no public access
        if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001 - the same
            return action
    return None


def actions(parser: argparse.ArgumentParser) -> dict[str, Any]:
    """Return the parsers of a command's actions, such as ``list`` of ``arena``."""
    holder = subparsers_of(parser)
    return {} if holder is None else dict(holder.choices)
