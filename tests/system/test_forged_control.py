"""Forged control messages of a process on the same machine change no run."""

import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from coordinator.storage.compare import compare
from schema.limits import MOST_EPOCH
from tests.system.attacker import FALSE_REPLIES, Attacker, attacker_at
from tests.system.documents import SCENARIO1
from tests.system.workspace import PATIENCE_S, Workspace, wait_until

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
]

Forge = Callable[[Attacker], None]


def false_tokens(attacker: Attacker) -> None:
    """Declare tokens of thousands of agents that do not exist, describe all falsely."""
    attacker.answer_for("revolve/**/info", b"\xff")
    # Remove and declare tokens of the workers' names under the other prefix.
    for chunk, other in (("/w/", "/an/"), ("/an/", "/w/")):
        for member in attacker.agents("worker" if chunk == "/w/" else "analyzer"):
            key = member.alive.replace(chunk, other)
            attacker.session.liveliness().declare_token(key).undeclare()  # type: ignore[no-untyped-call]
            attacker.declare(key)
            attacker.declare(member.alive)
    # Last: a query of so many tokens by this session would not return.
    for number in range(2000):
        attacker.declare(f"revolve/default/w/fake-{number}/alive")


def epochs(attacker: Attacker) -> None:
    """Claim epochs of a coordinator that has taken over the run."""
    for epoch in (MOST_EPOCH, 2**64 - 1):
        attacker.claim(epoch)


FORGERIES: dict[str, tuple[Forge, str]] = {
    "epochs": (epochs, "fenced"),
    "answers": (lambda a: a.answer_for("revolve/**/jobs", *FALSE_REPLIES), "foreign"),
    "silence": (lambda a: a.keep_silent_for("revolve/**"), ""),
    "cancelled": (lambda a: a.cancel(), "cancelled"),
    "tokens": (false_tokens, ""),
    "deadly": (lambda a: a.replace_by_deadly(20, times=4), "death"),
    "deaths": (lambda a: a.report_deaths(range(1, 4)), "death"),
}
"""What each attacker does, and the kind of fault that the coordinator tells."""


@pytest.mark.slow
@pytest.mark.parametrize("name", FORGERIES)
def test_a_run_beside_a_forger_equals_an_undisturbed_one(
    workspace: Workspace, undisturbed: Path, name: str
) -> None:
    forge, kind = FORGERIES[name]
    folder = workspace.folder / "run"
    # A single worker: no other one gets a copy of the job that takes long.
    workers = 1 if name == "deadly" else 2
    flags = ("--workers", str(workers), "--out", "run", "--cpu-limit", "1")
    process = workspace.start("run", *SCENARIO1, *flags)
    with attacker_at(folder) as attacker:
        wait_until(
            lambda: len(attacker.agents("worker")) == workers, "the workers are there"
        )
        forge(attacker)
        while name == "epochs" and process.poll() is None:
            forge(attacker)
            with suppress(subprocess.TimeoutExpired):
                process.wait(0.1)
        out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, err
    assert compare(undisturbed, folder) == []
    assert "Traceback" not in err
    assert "\x1b" not in out + err
    if kind:
        assert f" {kind}: " in err.partition("not used: ")[2], err
