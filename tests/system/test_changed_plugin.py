"""A run whose plug-in was changed after its start."""

import signal

import pytest

from tests.system.workspace import PATIENCE_S, Workspace, wait_until

pytestmark = pytest.mark.system

DOCUMENT = """
name = "mine"
births = 8
[selection]
population = 6
[simulation]
warmup_steps = 5
window_steps = 40
[fitness]
function = "lab:far"
"""
MODULE = """
def far(track, fitness):
    return float(track.core_position[-1, 0])
"""
FAULTY = "\ndef far(track):\n    return 0.0\n"
HOW = ("--in-process", "--quiet")


def test_resume_and_check_name_the_changed_module(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is simulated by a plug-in that is not the one of the run."""
    # As an installed command: the folder is not searched for modules.
    monkeypatch.setenv("PYTHONSAFEPATH", "1")
    run, module = workspace.folder / "a", workspace.folder / "lab.py"
    (workspace.folder / "mine.toml").write_text(DOCUMENT)
    module.write_text(MODULE)
    workspace.run("run", "mine.toml", "--out", "a", *HOW)
    assert "lab.py:2: in order" in workspace.run("check", "a")
    state = (run / "state").read_text()
    (run / "state").write_text("stopped")
    before = (run / "journal.bin").read_bytes()

    module.write_text(FAULTY)
    for words, code in ((("resume", "a", *HOW), 2), (("check", "a"), 1)):
        (line,) = workspace.run(*words, code=code).splitlines()[-1:]
        assert "plug-in lab: " in line
        assert "has changed since the run began" in line
        assert line.endswith(": --plugins a/plugins/lab.py")
    told = workspace.run("check", "mine.toml", code=1)
    assert "lab.py:2: 'lab:far' must take 2 arguments" in told
    assert (run / "journal.bin").read_bytes() == before

    (run / "state").write_text(state)
    assert "a: already finished" in workspace.run("resume", "a", *HOW)
    (run / "state").write_text("stopped")

    kept = ("--plugins", "a/plugins/lab.py")
    assert "in order" in workspace.run("check", "a", *kept)
    workspace.run("resume", "a", *HOW, *kept)
    assert (run / "state").read_text().strip() == "finished"


def test_the_named_copy_comes_before_a_file_of_the_current_folder(
    workspace: Workspace,
) -> None:
    """``python -m revolve`` searches the folder for modules; so do its workers."""
    run, module = workspace.folder / "a", workspace.folder / "lab.py"
    slow = DOCUMENT.replace("births = 8", "births = 40").replace("= 40\n[", "= 600\n[")
    (workspace.folder / "mine.toml").write_text(slow)
    module.write_text(MODULE)
    own = ("--workers", "1", "--quiet")
    started = workspace.start("run", "mine.toml", "--out", "a", *own)
    journal = run / "journal.bin"
    wait_until(lambda: journal.exists() and journal.stat().st_size > 3000, "births")
    started.send_signal(signal.SIGINT)
    started.communicate(timeout=PATIENCE_S)
    assert (run / "state").read_text().strip() == "stopped"
    module.write_text(FAULTY)

    line = workspace.run("resume", "a", *own, code=2).splitlines()[-1]
    assert "to use that one: --plugins a/plugins/lab.py" in line
    kept = ("--plugins", "a/plugins/lab.py")
    assert "lab.py:2: in order" in workspace.run("check", "a", *kept)
    workspace.run("resume", "a", *own, *kept)
    assert (run / "state").read_text().strip() == "finished"
    workspace.run("robot", "simulate", "a/best.yaml", *kept)

    elsewhere = workspace.folder / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "lab.py").write_text(FAULTY)
    words = ("robustness", "../a", "--plugins", "../a/plugins/lab.py")
    done = workspace.start(*words, "--workers", "1", folder=elsewhere)
    output, errors = done.communicate(timeout=PATIENCE_S)
    assert done.returncode == 0, output + errors
