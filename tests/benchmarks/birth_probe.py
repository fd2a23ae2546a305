"""Probe of ``birth_trace.py``: records calls between the project's files.

``birth_trace.py`` copies this file as ``sitecustomize.py`` into a folder of PYTHONPATH,
so every process of a run imports it before the project's modules. It depends on no
module of the project, only on the root of the tree and the names of its top folders.

A process writes its records when it ends: a line of JSON (``files``, ``marks``,
``bits``), then unsigned 64-bit integers, one per call: microseconds, number of the
calling file, number of the called file, both ``bits`` wide. File 0 stands for all files
outside the project.
"""

import atexit
import json
import os
import sys
import time
from array import array
from collections.abc import Callable, Sequence
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pathlib import Path
from types import FrameType, FunctionType, MethodType, ModuleType
from typing import Any

FOLDER = "BIRTH_TRACE_FOLDER"
"""Environment variable: output folder of the records."""
ROOT = "BIRTH_TRACE_ROOT"
"""Environment variable: root of the traced tree."""
BEGIN = "BIRTH_TRACE_BEGIN_US"
"""Environment variable: zero of all recorded times, on the monotonic clock [us]."""
TOPS = ("schema", "coordinator", "worker", "analyzer", "analysis", "revolve")
"""Folders and single files in the root that contain the project's code."""
BITS = 12
"""Width of a file number in a record."""
SLOWER = 1000
"""Factor by which the project's wall clock slows down after the first mating."""

_SEED_WORDS = 4
_KEY_LENGTH = 5  # run, island, birth, attempt, purpose
_PARENTS = 2
_OPTIMIZED = 0x01  # flag of function code, not of module or class bodies

_now_ns = time.monotonic_ns
_monotonic_s = time.monotonic


class Probe:
    """Records of one process.

    Attributes:
        marks: island, birth and time [us] of each parent selection.
    """

    def __init__(self, root: Path, folder: Path, begin_us: int) -> None:
        self.marks: list[tuple[int, int, int]] = []
        self._begin_us = begin_us
        self._root = f"{root}{os.sep}"
        self._folder = folder
        self._names = [""]
        self._numbers: dict[str, int] = {}
        self._records = array("Q")
        self._slow_since_s: float | None = None

    def install(self) -> None:
        """Trace all Python threads; patch the clock and two libraries."""
        import threading  # noqa: PLC0415 - binds the original clock

        time.monotonic = self.monotonic
        threading.setprofile(self.record)
        sys.setprofile(self.record)
        sys.meta_path.insert(0, _Patches(self))
        atexit.register(self.write)

    def record(self, frame: FrameType, event: str, _argument: object) -> None:
        """Record a call of a function of the project (a profile function)."""
        if event != "call":
            return
        code = frame.f_code
        called = self._number(code.co_filename)
        if not called or not code.co_flags & _OPTIMIZED:
            return
        back, caller = frame.f_back, 0
        while back is not None and not caller:
            caller = self._number(back.f_code.co_filename)
            back = back.f_back
        self._records.append(((self._now_us() << BITS | caller) << BITS) | called)

    def traced(self, function: Any) -> Any:  # noqa: ANN401 - any callable
        """Return a callback that is traced on threads that Python did not start."""
        if not isinstance(function, FunctionType | MethodType):
            return function

        def call(*arguments: object) -> object:
            sys.setprofile(self.record)
            return function(*arguments)

        return call

    def mark(self, key: Sequence[int]) -> None:
        """Record the first parent selection of a birth, given its stream's key."""
        if len(key) != _KEY_LENGTH or (key[3], key[4]) != (0, _PARENTS):
            return
        if self._slow_since_s is None:
            self._slow_since_s = _monotonic_s()
        self.marks.append((int(key[1]), int(key[2]), self._now_us()))

    def monotonic(self) -> float:
        """Return the time [s], slowed down for the project after the first mating."""
        since_s, now_s = self._slow_since_s, _monotonic_s()
        caller: FrameType | None = sys._getframe(1)
        while caller is not None and caller.f_code.co_filename == "<string>":
            caller = caller.f_back  # generated methods of dataclasses
        is_own = caller is not None and self._number(caller.f_code.co_filename)
        if since_s is None or not is_own:
            return now_s
        return since_s + (now_s - since_s) / SLOWER

    def write(self) -> None:
        """Write the records, if any."""
        sys.setprofile(None)
        if not self._records:
            return
        entries = {"files": self._names, "marks": self.marks, "bits": BITS}
        head = json.dumps(entries)
        path = self._folder / f"{os.getpid()}.trace"
        path.write_bytes(head.encode() + b"\n" + self._records.tobytes())

    def _now_us(self) -> int:
        return _now_ns() // 1000 - self._begin_us

    def _number(self, file: str) -> int:
        """Return the number of a file of the project, 0 for other files."""
        known = self._numbers.get(file)
        return self._new_number(file) if known is None else known

    def _new_number(self, file: str) -> int:
        number = 0
        if file.startswith(self._root) and not file.endswith("_pb2.py"):
            name = file.removeprefix(self._root).replace(os.sep, "/")
            if name.partition("/")[0].removesuffix(".py") in TOPS:
                number = len(self._names)
                self._names.append(name)
        self._numbers[file] = number
        return number


class _Patches:
    """Patches libraries after their import (an entry of ``sys.meta_path``)."""

    def __init__(self, probe: Probe) -> None:
        self._pending: dict[str, Callable[[ModuleType], None]] = {
            "numpy.random": lambda module: _patch_streams(module, probe),
            "zenoh": lambda module: _patch_callbacks(module, probe),
        }

    def find_spec(
        self, name: str, _path: object = None, _target: object = None
    ) -> ModuleSpec | None:
        patch = self._pending.pop(name, None)
        if patch is None:
            return None
        spec = find_spec(name)
        assert spec is not None
        assert spec.loader is not None
        execute = spec.loader.exec_module

        def load(module: ModuleType) -> None:
            execute(module)
            patch(module)

        spec.loader.exec_module = load  # type: ignore[method-assign]
        return spec


def _patch_streams(module: Any, probe: Probe) -> None:  # noqa: ANN401 - numpy.random
    """Record the spawn keys of random streams; 32-bit words hold one after four."""

    class Marked(module.SeedSequence):  # type: ignore[misc]
        def __init__(
            self,
            entropy: int | Sequence[int] | None = None,
            *,
            spawn_key: Sequence[int] = (),
            **more: int,
        ) -> None:
            super().__init__(entropy, spawn_key=spawn_key, **more)
            if entropy is not None and not isinstance(entropy, int):
                spawn_key = entropy[_SEED_WORDS:]
            probe.mark(spawn_key)

    module.SeedSequence = Marked


def _patch_callbacks(module: Any, probe: Probe) -> None:  # noqa: ANN401 - zenoh
    """Trace callbacks that run on the network's threads."""
    original = module.handlers.Callback

    def callback(function: Any, *more: Any, **named: Any) -> Any:  # noqa: ANN401
        others = [probe.traced(each) for each in more]
        return original(probe.traced(function), *others, **named)

    module.handlers.Callback = callback


if FOLDER in os.environ:
    Probe(
        Path(os.environ[ROOT]), Path(os.environ[FOLDER]), int(os.environ[BEGIN])
    ).install()
