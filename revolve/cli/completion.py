"""``revolve completion``: completion scripts for shells, made by shtab.

A script is static: pressing Tab starts no Python. shtab (MPL-2.0) is
loaded by this command only.
"""

import argparse

from coordinator.storage.campaign import shipped_campaigns
from revolve.cli.commands import COMMANDS, actions, parser_of, subparsers_of
from schema.agent.flags import Flags
from schema.experiment.file import shipped_experiments

_SHELLS = {
    "bash": "~/.local/share/bash-completion/completions/revolve",
    "zsh": "~/.zfunc/_revolve    # a folder of $fpath",
    "fish": "~/.config/fish/completions/revolve.fish",
}
"""Where each shell looks for its script."""

_EXPERIMENTS = {
    "bash": """\
_revolve_experiments() {{
  compgen -W "{names}" -- "$1"
  compgen -f -X '!*.toml' -- "$1"
  compgen -d -- "$1"
}}""",
    "zsh": """\
_revolve_experiments() {{
  _alternative 'names:experiment:({names})' 'files:file:_files -g "*.toml"'
}}""",
    "fish": """\
function _revolve_experiments
  printf '%s\\n' {names}
  __fish_complete_suffix .toml
end""",
}
"""Functions of the shells that complete shipped experiments and .toml files."""

_FOLDERS = {"FOLDER", "RUN", "DIR", "ADDRESS"}
_FILES = {"FILE", "OUTPUT", "OUT.png|OUT.gif", "PLUGIN", "MODULE|FILE"}
_NAMED = {"EXPERIMENT", "NAME|FILE.toml"}
"""Names of values in the help, by what completes them."""


def main(arguments: list[str]) -> int:
    """Print a completion script; return the exit code."""
    import shtab

    options = parser().parse_args(arguments[1:])
    print(shtab.complete(_whole_parser(), options.shell))
    return 0


def parser(_command: str = "completion") -> Flags:
    """Return the parser of ``revolve completion``."""
    flags = Flags(
        prog="revolve completion",
        description="Print a script that completes commands, flags, experiments and "
        "run folders when you press Tab.",
        examples=[f"revolve completion {one} > {_SHELLS[one]}" for one in _SHELLS],
    )
    flags.add_argument(
        "shell", choices=list(_SHELLS), metavar="SHELL", help=", ".join(_SHELLS)
    )
    return flags


def _whole_parser() -> argparse.ArgumentParser:
    """Return one parser with all commands, whose values know what completes them."""
    whole = argparse.ArgumentParser(prog="revolve")
    whole.add_argument("--version", action="store_true", help="show versions")
    commands = whole.add_subparsers(dest="command")
    for name, (_, summary) in COMMANDS.items():
        own = parser_of(name)
        for part in (own, *actions(own).values()):
            _mark_values(part)
        first, _, second = name.partition(" ")
        where = commands if not second else subparsers_of(commands.choices[first])
        assert where is not None
        where.add_parser(
            second or first, parents=[own], add_help=False, help=summary,
            description=summary,
        )  # fmt: skip
    help_flags = commands.add_parser("help", help="show the help of a command")
    words = sorted({name.split()[0] for name in COMMANDS})
    help_flags.add_argument("name", choices=words, help="command")
    return whole


def _mark_values(parser: argparse.ArgumentParser) -> None:
    """Tell shtab what completes the values of a parser's arguments."""
    import shtab

    names = " ".join([*shipped_experiments(), *shipped_campaigns()])
    experiments = {
        "bash": "_revolve_experiments",
        "zsh": "_revolve_experiments",
        "fish": "(_revolve_experiments)",
        "preamble": {
            shell: text.format(names=names) for shell, text in _EXPERIMENTS.items()
        },
    }
    for action in parser._actions:  # noqa: SLF001 - argparse has no public access
        values = {str(action.metavar)}
        if values & _NAMED:
            action.complete = experiments  # type: ignore[attr-defined]
        elif values & _FOLDERS:
            action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
        elif values & _FILES:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
