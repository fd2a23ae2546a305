"""The public names, their loading, and what importing them leaves alone."""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import revolve
from revolve import strangers
from tests.system.workspace import Workspace

TOP = Path(__file__).parents[2]

_STATE = """
import json, os, signal, sys, time
def state():
    return [dict(os.environ), [str(signal.getsignal(n)) for n in range(1, 32)],
            os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)]
before = state()
began_s = time.process_time()
import revolve
took_s = time.process_time() - began_s
loaded = [name for name in sys.modules if name.partition(".")[0] in
          ("numpy", "mujoco", "zenoh", "pyarrow", "schema", "worker", "coordinator")]
robot = revolve.Robot.random(seed=1)
revolve.Experiment.read("scenario1")
assert revolve.evaluate(robot).failure == ""
with revolve.Fleet(workers=1) as fleet:
    assert next(fleet.evaluate([robot])).failure == ""
print(json.dumps([took_s, loaded, before == state()]))
"""


@pytest.mark.system
def test_import_is_fast_and_leaves_the_process_as_it_is(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    took_s, loaded, is_same = json.loads(workspace.python("-c", _STATE))
    assert took_s < 1.0
    assert loaded == []
    assert is_same


def test_each_public_name_is_loaded_and_documented() -> None:
    names = dir(revolve)
    assert len(names) > 30
    for name in names:
        found = getattr(revolve, name)
        assert getattr(found, "__doc__", None), name
    assert names == sorted(vars(revolve)["__all__"])


@pytest.mark.parametrize(
    "method",
    [
        "FitnessFunction.__call__", "MeasureFunction.__call__",
        "ParentSelection.__call__", "SurvivorSelection.__call__",
        "Learner.ask", "Learner.tell", "BrainGenes.grow", "BrainControl.pack",
        "BrainControl.bank", "Bank.step", "Encoding.develop", "NeuronType.step",
        "SensorType.read",
    ],
)  # fmt: skip
def test_protocols_of_plug_ins_are_public_and_in_the_reference(method: str) -> None:
    name, _, member = method.partition(".")
    assert getattr(revolve, name)._is_protocol
    assert getattr(getattr(revolve, name), member).__doc__
    assert f"### `{method}`" in (TOP / "docs" / "reference.md").read_text("utf-8")


def test_types_are_those_of_the_loaded_objects() -> None:
    tree = ast.parse((TOP / "revolve" / "__init__.pyi").read_text("utf-8"))
    typed = {
        alias.asname: node.module
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert typed.pop("main") == "revolve.command"
    typed["gym"] = f"{typed['gym']}.gym"  # a module
    assert typed == vars(revolve)["_HOMES"]


def test_a_misspelt_name_gets_the_nearest() -> None:
    with pytest.raises(AttributeError, match="did you mean 'evaluate'"):
        _ = revolve.evalute  # type: ignore[attr-defined]


@pytest.mark.parametrize("how", ["before", "instead"])
def test_a_stranger_called_schema_is_named_in_one_line(
    how: str, tmp_path: Path
) -> None:
    # As PyPI's package: before ours on the path, or its files over ours.
    place = tmp_path / "schema"
    if how == "instead":
        for name in ("revolve", *strangers.ROOMS):
            (tmp_path / name).symlink_to(TOP / name)
        place.unlink()
    place.mkdir()
    (place / "__init__.py").write_text('"""Validation."""\n\n__version__ = "0.7.8"\n')
    advice = "rename yours" if how == "before" else "environment of its own"
    search = [str(tmp_path)] if how == "instead" else [str(tmp_path), str(TOP)]
    for words in (["-m", "revolve"], ["-c", "from revolve import Robot"]):
        done = subprocess.run(
            [sys.executable, *words],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(search)},
            capture_output=True,
            text=True,
            check=False,
        )
        last = done.stderr.splitlines()[-1]
        assert done.returncode
        assert "'schema' is not that of Revolve Islands" in last
        assert last.endswith(advice)
        if "-m" in words:
            assert (done.returncode, done.stderr.count("\n")) == (2, 1)
