"""Settings of all tests, made before other modules are imported."""

import logging
import os
import resource
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from itertools import count
from pathlib import Path

import pytest
from hypothesis import settings

from analysis.render.stage import choose_engine
from schema.plugins import permission
from schema.robot.brain import INPUT, Brain, Neuron
from schema.robot.robot import Part, Robot
from tests import command_server
from tests.own_brains import write_module

# MuJoCo selects its rendering engine when it is first imported, by whichever test comes
# first. Processes that tests start select their own engine.
_SETTING = os.environ.get("MUJOCO_GL")
choose_engine()
import mujoco  # noqa: E402, F401

if _SETTING is None:
    os.environ.pop("MUJOCO_GL", None)

# Use the same examples in every run, independent of the machine's speed, so that
# failures are reproducible. Set here because tests take the settings that are active
# when they are decorated.
settings.register_profile("fixed", derandomize=True, database=None, deadline=None)
settings.load_profile("fixed")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_setupnodes(config: pytest.Config) -> None:
    """Start one server of commands for all processes of a test session that uses it."""
    if "not system" not in config.option.markexpr and sys.platform == "linux":
        os.environ[command_server.ADDRESS] = command_server.address()


_VARIABLES = dict(os.environ)


def _reset_environment() -> None:
    kept = {name for name in os.environ if name.startswith("PYTEST_")}
    for name in os.environ.keys() - _VARIABLES.keys() - kept:
        del os.environ[name]
    os.environ.update(_VARIABLES)


@pytest.fixture(autouse=True)
def _own_environment() -> Iterator[None]:
    """Undo what a command has set for its process and children.

    Both before and after a test, as fixtures of a wider scope run commands, too.
    """
    _reset_environment()
    yield
    _reset_environment()


@pytest.fixture(autouse=True)
def _plain_log(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let no test change the form of the lines that others compare."""
    monkeypatch.setenv("REVOLVE_LOG", "")
    yield
    logging.getLogger("revolve").handlers.clear()


@pytest.fixture(autouse=True)
def _plugins_of_a_test(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forget after each test which modules it has allowed, and their copies."""
    monkeypatch.setattr(permission, "_copies", {})
    monkeypatch.setattr(permission, "_allowed", dict(permission._allowed))


@pytest.fixture
def _nothing_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Allow no module."""
    monkeypatch.setattr(permission, "_allowed", {})


@pytest.fixture
def _own_brains(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Allow the module of docs/brains.md as ``my_brains``, also to be imported."""
    monkeypatch.syspath_prepend(tmp_path)
    module = {"my_brains": write_module(tmp_path)}
    monkeypatch.setattr(permission, "_allowed", {**permission._allowed, **module})


@pytest.fixture
def own_module(tmp_path: Path) -> Callable[[str], str]:
    """Return a function that writes and allows a plug-in module; it returns its name.

    Modules stay imported, so that each has a name of its own.
    """
    numbers = count()

    def write(text: str) -> str:
        name = f"{tmp_path.name.replace('-', '_')}_{next(numbers)}"
        (tmp_path / f"{name}.py").write_text(text)
        permission.allow([str(tmp_path / f"{name}.py")])
        return name

    return write


@pytest.fixture
def chain() -> Robot:
    """Return a robot of 400 parts, each on the last: a core and bricks."""
    grey = (0.5, 0.5, 0.5)
    bricks = (
        Part("FixedBrick", index, 1 if index else 0, 0, 0, grey) for index in range(399)
    )
    senses = tuple(Neuron("input", INPUT, 0) for _ in range(6))
    return Robot((Part("Core", -1, -1, -1, 0, grey), *bricks), Brain(senses))


@contextmanager
def no_file_beyond(size: int) -> Iterator[None]:
    """Limit the size of this process's files, to imitate a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.fixture
def full_beyond() -> Callable[[int], AbstractContextManager[None]]:
    """Return a context that limits the size of files."""
    return no_file_beyond
