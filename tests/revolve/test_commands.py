"""Help, examples and versions of all commands."""

import argparse
import errno
import re
import shlex
import sys
from collections import defaultdict

import pytest

from revolve.cli.commands import COMMANDS, actions, parser_of
from revolve.command import main
from schema.agent.flags import Flags


@pytest.fixture(scope="module")
def parsers() -> dict[str, Flags]:
    """Parsers of all commands and of their actions, such as ``arena list``."""
    found: dict[str, Flags] = {}
    for command in COMMANDS:
        found[command] = parser_of(command)
        for name, parser in actions(found[command]).items():
            found[f"{command} {name}"] = parser
    return found


def test_each_help_has_two_to_four_examples_that_its_parser_accepts(
    parsers: dict[str, Flags],
) -> None:
    for name, parser in parsers.items():
        assert 2 <= len(parser.examples) <= 4, name
        for example in parser.examples:
            assert f"\n  {example}\n" in parser.format_help()
            words = shlex.split(example.partition(" > ")[0], comments=True)
            assert words[0] == "revolve"
            assert " ".join(words[1:]).startswith(name), example
            command = max(
                (
                    each
                    for each in COMMANDS
                    if words[1:][: len(each.split())] == each.split()
                ),
                key=len,
            )
            rest = words[1 + len(command.split()) :]
            parsers[command].parse_args(rest)  # exits if it is refused


def test_each_argument_has_a_description_and_a_value_name(
    parsers: dict[str, Flags],
) -> None:
    for name, parser in parsers.items():
        for action in parser._actions:
            if isinstance(action, argparse._SubParsersAction):
                continue
            if action.help == argparse.SUPPRESS:
                continue
            assert action.help, (name, action.dest)
            if action.nargs != 0 and action.choices is None:
                assert action.metavar, (name, action.dest)


def test_a_flag_has_the_same_description_in_all_commands(
    parsers: dict[str, Flags],
) -> None:
    """Equal up to the first punctuation mark: the rest is what a command adds."""
    found: defaultdict[tuple[str, str], dict[str, str]] = defaultdict(dict)
    for name, parser in parsers.items():
        for action in parser._actions:
            for flag in action.option_strings or [str(action.metavar)]:
                if action.help != argparse.SUPPRESS:
                    start = re.split(r" ?[,:;(]", str(action.help))[0]
                    found[flag, str(action.metavar)].setdefault(start, name)
    different = {key: starts for key, starts in found.items() if len(starts) > 1}
    assert different == {}


def test_help_of_a_command_is_that_of_its_flag(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for words in (["status"], ["robot", "random"], ["arena", "insert"], ["robot"]):
        shown = []
        for line in (["help", *words], [*words, "--help"]):
            with pytest.raises(SystemExit) as end:
                main(line)
            assert end.value.code == 0
            shown.append(capsys.readouterr().out)
        assert shown[0] == shown[1]
        assert shown[0].startswith(f"usage: revolve {' '.join(words)}")
    assert main(["help"]) == main(["--help"]) == 0
    first, _, second = capsys.readouterr().out.partition("\n\nEvolve")
    assert "revolve help COMMAND" in first or "revolve help COMMAND" in second


def test_a_misspelt_flag_is_named_with_the_nearest(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for command, words, message in (
        ("run", ["scenario1", "--birth", "3"], "run: no flag '--birth'; did you mean"),
        ("run", ["scenario1", "--birth=3"], "'--births'? (see revolve run --help)"),
        ("arena", ["list", "--conect", "x"], "arena list: no flag '--conect'; did you"),
        ("status", ["a", "b"], "status: unexpected argument 'b' (see"),
    ):
        with pytest.raises(SystemExit) as end:
            parser_of(command).parse_args(words)
        assert end.value.code == 2
        said = capsys.readouterr().err
        assert message in said
        assert said.count("\n") == 1


def test_an_error_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    """It may quote what a plug-in raised, or a file's name."""
    assert main(["robot", "check", "two\nlines.yaml"]) == 2
    said = capsys.readouterr().err
    assert "two lines.yaml" in said
    assert said.count("\n") == 1


def test_the_version_names_what_decides_results(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["--version"]) == 0
    own, machine, libraries = capsys.readouterr().out.splitlines()
    assert re.match(r"revolve \d+\.\d+\.\d+|revolve not installed", own)
    assert re.match(r"Python 3\.\d+\.\d+, \w+ \w+", machine)
    for name in ("MuJoCo", "Zenoh", "Arrow", "NumPy"):
        assert re.search(rf"\b{name} \d+\.\d+", libraries)


def test_a_run_shows_at_once_on_a_terminal_that_it_starts(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = {}
    for is_terminal, flags in ((True, []), (True, ["--quiet"]), (False, [])):
        monkeypatch.setattr(sys.stderr, "isatty", lambda is_it=is_terminal: is_it)
        assert main(["run", "nonsense", *flags]) == 2
        lines[is_terminal, *flags] = capsys.readouterr().err
    start, _, error = lines[True,].partition("\r")
    assert start == "starting ..."
    # The next line is longer and replaces it.
    assert len(error.splitlines()[0]) > len(start)
    assert "nonsense: no such experiment" in error
    assert not any("starting" in lines[key] for key in lines if key != (True,))


@pytest.mark.parametrize("words", [["status"], ["robot", "show"], ["run"], ["log"]])
def test_a_name_that_is_too_long_is_told_in_a_line(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, "x" * 300]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert re.search(r"revolve: x+\.\.\.: the name is longer than the system", line)


def test_a_process_with_too_few_files_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(_: list[str]) -> int:
        raise OSError(errno.EMFILE, "Too many open files", "run/segments")

    monkeypatch.setattr("coordinator.cli.status.main", fail)
    assert main(["status", "run"]) == 2
    assert "revolve: too many open files: raise the limit (ulimit -n)" in (
        capsys.readouterr().err
    )
