"""Forked commands are like those of new interpreters."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.command import command
from tests.command_server import ADDRESS
from tests.system.workspace import wait_until

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(sys.platform != "linux", reason="others start interpreters"),
]

TOP = Path(__file__).parents[1]
OWN = """
import json, os, pathlib, sys, threading

pathlib.Path("seen.new").write_text(json.dumps({
    "words": sys.argv[1:],
    "main": sys.modules["__main__"].__spec__.name,
    "folder": os.getcwd(),
    "path": sys.path,
    "environment": dict(os.environ),
    "leads": os.getsid(0) == os.getpid(),
    "threads": threading.active_count(),
    "files": [os.readlink(f"/proc/self/fd/{number}") for number in range(3)],
    "open": len(os.listdir("/proc/self/fd")),
    "process": os.getpid(),
}))
os.rename("seen.new", "seen")
"""
STARTER = """
import signal
from tests.command import command

print(command()[-2], flush=True)
signal.pause()
"""
WORDS = ("plugins", "--plugins", "own.py")


def _start(folder: Path, *start: str) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "PYTHONPATH": str(TOP), "NAME": "Größe"}
    return subprocess.Popen(
        [*start, *WORDS],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def _seen(folder: Path, *start: str) -> dict[str, Any]:
    """Run a command to its end; return what a plug-in has seen of its process."""
    assert _start(folder, *start).wait() == 0
    seen: dict[str, Any] = json.loads((folder / "seen").read_text())
    del seen["process"]
    return seen


def test_forked_command_has_files_folder_and_environment_of_a_new_one(
    tmp_path: Path,
) -> None:
    (tmp_path / "own.py").write_text(OWN)
    new = _seen(tmp_path, sys.executable, "-m", "revolve")
    assert new["environment"]["NAME"] == "Größe"
    assert _seen(tmp_path, *command()) == new


def _waiting(folder: Path, server: list[str]) -> tuple[subprocess.Popen[bytes], Path]:
    """Return the client of a command that waits for ever, and where it is listed."""
    (folder / "own.py").write_text(f"{OWN}\nimport signal; signal.pause()")
    client = _start(folder, *server)
    wait_until((folder / "seen").exists, "the command is at its plug-in")
    process = json.loads((folder / "seen").read_text())["process"]
    return client, Path(f"/proc/{process}")


def test_command_is_killed_with_its_client(tmp_path: Path) -> None:
    client, process = _waiting(tmp_path, command())
    client.kill()
    client.wait()
    wait_until(lambda: not process.exists(), "the command ends")


def test_command_is_killed_with_whoever_started_its_server(tmp_path: Path) -> None:
    others = {name: text for name, text in os.environ.items() if name != ADDRESS}
    tests = subprocess.Popen(
        [sys.executable, "-c", STARTER],
        env={**others, "PYTHONPATH": str(TOP)},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert tests.stdout is not None
    socket = tests.stdout.readline().strip()
    client, process = _waiting(tmp_path, [*command()[:-2], socket, ""])
    tests.kill()
    tests.communicate()
    assert client.wait() != 0
    wait_until(lambda: not process.exists(), "the command ends")
    shutil.rmtree(Path(socket).parent)
