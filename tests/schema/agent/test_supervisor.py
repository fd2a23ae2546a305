"""Settings of a process and of its children."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from schema.agent.supervisor import stop_on_signals

_ASK = "import os; print(os.sched_getscheduler(0) == os.SCHED_{})"
_CHILD = "import subprocess; subprocess.run([sys.executable, '-c', {!r}], check=True)"

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="other systems have no such policies"
)


def said(
    after: str, before: str = "", environment: Mapping[str, str | None] = {}
) -> list[str]:
    """Return the words that a process writes after ``prepare_process``."""
    preparation = (
        "from schema.agent.supervisor import prepare_process\nprepare_process()"
    )
    variables = {**os.environ, **environment}
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{before}\n{preparation}\n{after}\n"],
        check=True,
        stdout=subprocess.PIPE,
        text=True,
        env={name: value for name, value in variables.items() if value is not None},
    )
    return done.stdout.split()


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


@pytest.mark.parametrize("ask", ["exec({!r})", _CHILD])
def test_a_process_and_its_child_return_unused_memory(ask: str) -> None:
    """Memory is returned: 50 MiB of models are freed, small objects in between stay.

    Measured with and without the setting: where a C library returns the memory in both
    cases, the setting has no effect to test.
    """
    bare: dict[str, str | None] = {
        name: None for name in os.environ if name.startswith("MALLOC_")
    }
    left = {k: v for k, v in os.environ.items() if k not in bare}
    alone_mib = int(subprocess.check_output([sys.executable, "-c", _FORGET], env=left))
    (helped_mib,) = map(int, said(ask.format(_FORGET), environment=bare))
    assert helped_mib < 5
    if alone_mib < 5:
        pytest.skip("this C library returns freed memory without the setting")
    assert alone_mib > 40


@pytest.mark.parametrize(
    ("policy", "before"),
    [
        ("BATCH", ""),
        # Set by the user, and kept.
        (
            "IDLE",
            "import os; os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))",
        ),
    ],
)
def test_a_process_and_its_child_have_the_batch_policy_or_that_of_the_user(
    policy: str, before: str
) -> None:
    ask = _ASK.format(policy)
    assert said(f"{ask}\n{_CHILD.format(ask)}", before) == ["True", "True"]


@pytest.mark.parametrize(
    ("before", "expected"), [(None, "system"), ("mimalloc", "mimalloc")]
)
def test_arrow_returns_unused_memory_unless_the_user_chose_its_allocator(
    before: str | None, expected: str
) -> None:
    ask = "import pyarrow as pa; print(pa.default_memory_pool().backend_name)"
    assert said(ask, environment={"ARROW_DEFAULT_MEMORY_POOL": before}) == [expected]


_SHIELDED = """
import pathlib, signal, sys
from schema.agent.supervisor import ProcessPool, prepare_process

def body(folder, slot):
    masked = signal.pthread_sigmask(signal.SIG_BLOCK, [])
    pathlib.Path(folder, str(slot.index)).write_text(str(signal.SIGINT in masked))

if __name__ == "__main__":
    prepare_process()
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
def test_second_ctrl_c_at_once_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("schema.agent.supervisor._REPEAT_S", 60.0)
    stop = stop_on_signals()
    for _ in range(2):
        signal.raise_signal(signal.SIGINT)
        assert stop.is_set()
    monkeypatch.setattr("schema.agent.supervisor._REPEAT_S", 0.0)
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_a_process_that_draws_nothing_needs_no_graphics(
    capfd: pytest.CaptureFixture[str],
) -> None:
    """MuJoCo would refuse the value when it is imported."""
    ask = "import mujoco, os; print(mujoco.MjModel.__name__, os.environ['MUJOCO_GL'])"
    assert said(ask, environment={"MUJOCO_GL": "bogus"}) == ["MjModel", "disable"]
    assert "MUJOCO_GL=bogus does not work: invalid value" in capfd.readouterr().err


def test_a_process_may_open_as_many_files_as_the_system_allows() -> None:
    before = """
import resource
files = resource.RLIMIT_NOFILE
_, most = resource.getrlimit(files)
resource.setrlimit(files, (64, most))
"""
    assert said("print(resource.getrlimit(files) == (most, most))", before) == ["True"]
