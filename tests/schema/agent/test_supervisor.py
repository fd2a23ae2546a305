"""Settings of a process and of its children."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from multiprocessing import spawn
from pathlib import Path

import pytest

from schema.agent.import_path import safe_import_path
from schema.agent.supervisor import stop_on_signals

_ASK = "import os; print(os.sched_getscheduler(0) == os.SCHED_{policy})"
_START = (
    "import subprocess, sys\n"
    "from schema.agent.supervisor import prepare_process\n"
    "{before}\n"
    "prepare_process()\n"
    "{ask}\n"
    "subprocess.run([sys.executable, '-c', {ask!r}], check=True)\n"
)

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="other systems have no such policies"
)


def _said(policy: str, before: str = "") -> list[str]:
    """Return whether a process and its child have a policy, in their words."""
    text = _START.format(before=before, ask=_ASK.format(policy=policy))
    done = subprocess.run(
        [sys.executable, "-c", text], check=True, capture_output=True, text=True
    )
    return done.stdout.split()


def test_processes_use_the_batch_policy() -> None:
    assert _said("BATCH") == ["True", "True"]


def test_policy_set_by_the_user_is_kept() -> None:
    idle = "import os; os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))"
    assert _said("IDLE", idle) == ["True", "True"]


_IN_CHILD = (
    "import subprocess, sys\nsubprocess.run([sys.executable, '-c', {!r}], check=True)"
)
_FORGET = """
import ctypes, os
libc = ctypes.CDLL(None)
libc.malloc.restype = ctypes.c_void_p
libc.malloc.argtypes = [ctypes.c_size_t]
libc.free.argtypes = [ctypes.c_void_p]
def resident():  # unbuffered: a buffer would leave a hole for the blocks that stay
    with open("/proc/self/statm", "rb", buffering=0) as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE")
libc.free(libc.malloc(8 << 20))  # from such a block a C library may learn
for _ in range(1 << 12):  # fills the holes that are there
    libc.malloc(1 << 10)
before = resident()
large = []
for _ in range(50):
    large.append(libc.malloc(1 << 20))
    ctypes.memset(large[-1], 1, 1 << 20)
    libc.malloc(1 << 10)  # stays, and so would what lies below it
for block in large:
    libc.free(block)
print((resident() - before) >> 20)
"""


@pytest.mark.parametrize("ask", ["exec({!r})", _IN_CHILD])
def test_a_process_and_its_child_return_unused_memory(ask: str) -> None:
    """Memory is returned: 50 MiB of models are freed, small objects in between stay.

    Measured with and without the setting: where a C library returns the memory in both
    cases, the setting has no effect to test.
    """
    start = (
        "from schema.agent.supervisor import prepare_process\n"
        "prepare_process()\n" + ask.format(_FORGET)
    )
    bare = {k: v for k, v in os.environ.items() if not k.startswith("MALLOC_")}
    alone_mib, helped_mib = (
        int(subprocess.check_output([sys.executable, "-c", text], env=bare))
        for text in (_FORGET, start)
    )
    assert helped_mib < 5
    if alone_mib < 5:
        pytest.skip("this C library returns freed memory without the setting")
    assert alone_mib > 40


@pytest.mark.parametrize(
    ("before", "expected"), [("", "system"), ("mimalloc", "mimalloc")]
)
def test_arrow_returns_unused_memory_unless_the_user_chose_its_allocator(
    before: str, expected: str
) -> None:
    chosen = "ARROW_DEFAULT_MEMORY_POOL"
    clean = {name: value for name, value in os.environ.items() if name != chosen}
    text = (
        "from schema.agent.supervisor import prepare_process\n"
        "prepare_process()\n"
        "import pyarrow as pa\n"
        "print(pa.default_memory_pool().backend_name)"
    )
    done = subprocess.run(
        [sys.executable, "-c", text],
        check=True,
        capture_output=True,
        text=True,
        env=clean | ({chosen: before} if before else {}),
    )
    assert done.stdout.strip() == expected


_SHIELDED = """
import pathlib, signal, sys
from schema.agent.supervisor import ProcessPool

def body(folder, slot):
    masked = signal.pthread_sigmask(signal.SIG_BLOCK, [])
    pathlib.Path(folder, str(slot.index)).write_text(str(signal.SIGINT in masked))

if __name__ == "__main__":
    with ProcessPool(body, (sys.argv[1],), size=2) as pool:
        while len(pool.exit_codes) < 2:
            pool.wait(1.0)
            pool.look_after()
    print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []))
"""


def test_ctrl_c_reaches_no_child_from_its_start_on(tmp_path: Path) -> None:
    """Includes the first child, with which Python starts a process of its own.

    The current folder holds a module that hides one of the standard library.
    """
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "pickle.py").write_text("raise SystemExit(7)\n")
    script = tmp_path / "pool.py"
    script.write_text(_SHIELDED)
    done = subprocess.check_output(
        [sys.executable, script, tmp_path],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])},
        text=True,
        cwd=tmp_path / "here",
        timeout=60,
    )
    assert [(tmp_path / name).read_text() for name in "01"] == ["True", "True"]
    assert done.split() == ["False"]


@pytest.fixture
def _own_signals() -> Iterator[None]:
    before = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("_own_signals")
def test_second_ctrl_c_at_once_does_not_count(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("schema.agent.supervisor._REPEAT_S", 60.0)
    stop = stop_on_signals()
    for _ in range(2):
        signal.raise_signal(signal.SIGINT)
        assert stop.is_set()
    monkeypatch.setattr("schema.agent.supervisor._REPEAT_S", 0.0)
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_a_process_that_draws_nothing_needs_no_graphics() -> None:
    """MuJoCo would refuse the value when it is imported."""
    script = (
        "from schema.agent.supervisor import prepare_process\n"
        "prepare_process()\n"
        "import mujoco, os\n"
        "print(mujoco.MjModel.__name__, os.environ['MUJOCO_GL'])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "MUJOCO_GL": "bogus"},
    )
    assert done.stdout == "MjModel disable\n", done.stderr
    assert "MUJOCO_GL=bogus does not work: invalid value" in done.stderr


def test_a_process_may_open_as_many_files_as_the_system_allows() -> None:
    script = (
        "import resource\n"
        "files = resource.RLIMIT_NOFILE\n"
        "_, most = resource.getrlimit(files)\n"
        "resource.setrlimit(files, (64, most))\n"
        "from schema.agent.supervisor import prepare_process\n"
        "prepare_process()\n"
        "print(resource.getrlimit(files) == (most, most))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout == "True\n"


def test_a_child_whose_parent_dies_while_it_starts_is_silent() -> None:
    """It finds the end of the pipe that was to say what it has to do."""
    reader, writer = os.pipe()
    with safe_import_path():
        words = spawn.get_command_line(tracker_fd=reader, pipe_handle=reader)
    os.close(writer)
    with os.fdopen(reader):
        files = [reader]
        child = subprocess.run(words, pass_fds=files, capture_output=True, check=True)
    assert (child.stdout, child.stderr) == (b"", b"")
    assert "except" not in spawn.get_command_line(pipe_handle=0)[-2]
