"""Runs the code of a page of docs/ in one folder, in the order of a reader.

    python tests/docs/page_runner.py PAGE [NUMBER=OTHER ...]

- A block that begins with ``# NAME.py`` or ``# NAME.toml`` is a file.
- Other ``python`` blocks run in one session; warnings are errors.
- ``sh`` blocks are commands, one per line; ``# fails`` after one says that it fails.
- Each line of a ``text`` block must be in the output of the block before it, where
  ``...`` stands for any text.
- Blocks of other languages, or of none, are not run.

``NUMBER=OTHER`` replaces a number in commands, their output and experiments, so that a
test has fewer births than the page.
"""

import contextlib
import io
import re
import shlex
import subprocess
import sys
import traceback
import warnings
from pathlib import Path
from typing import Any

from tests.command import command

_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_FILE = re.compile(r"# ([\w-]+\.(?:py|toml))\n")
_NO_ENGINE = "pictures need"
"""Part of the message of a machine without EGL and OSMesa."""


class PageError(Exception):
    """A block does not do what the page says."""


def blocks(page: Path) -> list[tuple[str, str]]:
    """Return language and text of all blocks, in order."""
    return _BLOCK.findall(page.read_text("utf-8"))


def blocks_of(page: Path, language: str) -> list[str]:
    """Return the text of all blocks of a language, in order."""
    return [text for found, text in blocks(page) if found == language]


def run_page(page: Path, numbers: dict[str, str]) -> int:
    """Run a page in the present folder; return the number of blocks.

    Args:
        page: a Markdown file.
        numbers: numbers that are replaced in commands, their output and experiments.

    Raises:
        PageError: a block fails, or its output is not that of the page.
    """
    session: dict[str, Any] = {"__name__": "session"}
    output, done = "", 0
    for language, text in blocks(page):
        if language not in {"python", "toml", "sh", "text"}:
            continue
        done += 1
        named = _FILE.match(text)
        if named:
            is_toml = language == "toml"
            code = _replaced(text, numbers) if is_toml else text
            Path(named[1]).write_text(code, "utf-8")
        elif language == "python":
            output = _python(text, session)
        elif language == "sh":
            output = "".join(
                _command(line, numbers) for line in text.strip().splitlines()
            )
        elif language == "text" and output != _NO_ENGINE:
            _compare(_replaced(text, numbers), output)
    return done


def _replaced(text: str, numbers: dict[str, str]) -> str:
    return re.sub(r"\d+", lambda found: numbers.get(found[0], found[0]), text)


def _python(text: str, session: dict[str, Any]) -> str:
    """Run a block of the session and return what it prints."""
    printed = io.StringIO()
    try:
        with contextlib.redirect_stdout(printed), warnings.catch_warnings():
            warnings.simplefilter("error")
            exec(compile(text, "block", "exec"), session)  # noqa: S102 - the page's own code
    except Exception as error:
        raise PageError(f"{text}\n{traceback.format_exc()}") from error
    return printed.getvalue()


def _command(line: str, numbers: dict[str, str]) -> str:
    """Run a command and return what it writes to both outputs."""
    words = shlex.split(_replaced(line, numbers), comments=True)
    if words[:2] == ["revolve", "run"] and "--workers" not in words:
        words += ["--in-process"]
    words = with_one_figure(words)
    program = command() if words[0] == "revolve" else [sys.executable]
    done = subprocess.run(
        [*program, *words[1:]], capture_output=True, text=True, check=False
    )
    said = done.stdout + done.stderr
    if "render" in words and _NO_ENGINE in said:
        return _NO_ENGINE
    if (done.returncode != 0) != line.endswith("# fails"):
        raise PageError(f"{line}: exit code {done.returncode}\n{said}")
    return said


def with_one_figure(words: list[str]) -> list[str]:
    """Return a command of a page that draws one figure where the page draws all.

    All take four times as long; test_analyze.py has them.
    """
    draws_all = words[:2] == ["revolve", "analyze"] and "--figures" not in words
    return [*words, "--figures", "6.3"] if draws_all else words


def _compare(text: str, output: str) -> None:
    """Raise unless each line of a text block is in an output."""
    for line in text.splitlines():
        parts = [
            r"\s+".join(map(re.escape, part.split())) for part in line.split("...")
        ]
        if not re.search(r".*".join(parts), output):
            raise PageError(f"not in the output: {line}\n{output}")


if __name__ == "__main__":
    numbers = dict(word.split("=") for word in sys.argv[2:])
    count = run_page(Path(sys.argv[1]), numbers)
    print(f"{count} blocks")  # noqa: T201 - this is a command
