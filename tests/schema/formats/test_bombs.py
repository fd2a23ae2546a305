"""Hostile robot files and experiments are refused within 100 MB and 1 s each."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from schema.errors import InvalidRobot
from schema.formats.files import read_robot, settings_of
from schema.formats.mjcf import robot_to_mjcf
from tests.schema.robots import robot_of

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")

MOST_MB = 100.0
MOST_S = 5.0

# Reads each file in a process of its own, forked after all imports, and prints memory
# beyond that of the start [MB], CPU time [s] and the error.
READ_ALL = """
import json, os, resource, sys, time
from pathlib import Path
import schema.formats.mjcf
from schema.errors import RevolveError
from schema.experiment.file import read_experiment
from schema.formats.files import read_robot

def peak_mb():
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024

for word in sys.argv[1:]:
    sys.stdout.flush()
    if os.fork() == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (5, 5))
        path, began_mb, began_s = Path(word), peak_mb(), time.process_time()
        try:
            read_experiment(word) if path.suffix == ".toml" else read_robot(path)
            error = ""
        except RevolveError as refusal:
            error = str(refusal)
        took_s = time.process_time() - began_s
        print(json.dumps([path.name, peak_mb() - began_mb, took_s, error]))
        sys.stdout.flush()
        os._exit(0)
    os.wait()
"""

NEURON = "  - {{id: n{0}, part: part-0, layer: hidden, type: Simple}}\n"
EDGE = "  - {{source: n{0}, target: n{0}, weight: 1}}\n"


def laughs(item: str, entity: str, join: str) -> str:
    """Return definitions, each of which names the one before nine times."""
    names = "abcdefghij"
    return "".join(
        entity.format(name, join.join([item.format(before)] * 9))
        for before, name in pairwise(names)
    )


ENTITIES = (
    '<!DOCTYPE m [<!ENTITY a "xxxxxxxxxxxxxxxxx">'
    + laughs("&{0};", '<!ENTITY {0} "{1}">', "")
    + "]>"
)


def mjcf(assets: str = "", world: str = "") -> str:
    """Return the MJCF of a robot with more in it."""
    text = robot_to_mjcf(robot_of(), settings_of(None))
    assert "<worldbody>" in text
    text = text.replace("<worldbody>", f"{assets}<worldbody>", 1)
    return text.replace("</worldbody>", f"{world}</worldbody>", 1)


def scenery(inside: str, before: str = "") -> str:
    text = f"{before}<mujoco><worldbody>{inside}</worldbody></mujoco>"
    return f"name = 'x'\n[environment]\nscenery = '''{text}'''"


def chain(parts: int) -> dict[str, list[dict[str, Any]]]:
    """Return RoboGen's body of bricks, each attached to the one before."""
    core = {"id": "p0", "type": "CoreComponent", "orientation": 0, "root": True}
    bricks = [
        {"id": f"p{i}", "type": "FixedBrick", "orientation": 0} for i in range(1, parts)
    ]
    edges = [
        {"src": f"p{i - 1}", "dest": f"p{i}", "srcSlot": 1, "destSlot": 0}
        for i in range(1, parts)
    ]
    return {"part": [core, *bricks], "connection": edges}


def many(unit: str, times: int, before: str = "", after: str = "") -> Callable[[], str]:
    """Return a function that makes a long text: long ones are not kept."""
    return lambda: before + unit * times + after


def neurons() -> str:
    numbers = range(5000)
    nodes, edges = ("".join(map(line.format, numbers)) for line in (NEURON, EDGE))
    wrong = "  - {source: nowhere, target: n1}\n"
    brain = f"brain:\n  neurons:\n{nodes}  connections:\n{edges}{wrong}"
    return f"body: {{type: Core}}\n{brain}"


def attributes() -> str:
    names = map("a{}=''".format, range(190_000))
    return f"<mujoco {' '.join(names)}/>"


GEOM = '<geom size="1"/>'
COPIES = f'<replicate count="9999999">{GEOM}</replicate>'
NESTED = f'<replicate count="200">{COPIES.replace("9999999", "200")}</replicate>'
HFIELD = '<asset><hfield nrow="30000" ncol="30000"/></asset>'
ALIASES = "a: &a [x]\n" + laughs("*{0}", "{0}: &{0} [{1}]\n", ",")
PARAM = """{"body": {"part": [{"id": "a", "type": "CoreComponent",
"orientation": 0, "evolvableParam": [{"paramValue": 1"""
STEEP = "roughness_m = 1.0\nextent_m = 1e6\npatch_m = 1e-300"
DEEP = "".join("\t" * i + f"0 F b{i} 0\n" for i in range(1, 1200))
ROBOT = "revolve_robot: "
MINE = "name = 'x'\n"
BOMBS: dict[str, tuple[Callable[[], str], str]] = {
    "laughs.yaml": (lambda: ALIASES, "aliases are not allowed"),
    "deep.yaml": (many("[", 900_000), "<= 400 levels"),
    "maps.yaml": (many("{a: ", 200_000), "<= 400 levels"),
    "list.yaml": (many("1,", 490_000, "body: [", "]"), "<= 100000 values"),
    "size.yaml": (many("1,", 10_000_000), "<= 1000000 bytes"),
    "scalar.yaml": (many("x", 900_000, ROBOT), "whole number"),
    "digits.yaml": (many("1", 900_000, ROBOT), "whole number"),
    "gene.yaml": (many("9", 4000, "body: {type: Core, gene: ", "}"), "gene: must"),
    "float.yaml": (lambda: "body: {type: Core, params: {red: 1e999999}}", "finite"),
    "word.yaml": (many("A", 900_000, "body: {type: ", "}"), "must be one of"),
    "brain.yaml": (neurons, "source: must be one of"),
    "deep.json": (many("[", 900_000), "not valid JSON"),
    "list.json": (
        many("[],", 300_000, '{"body": {"part": [', "[]]}}"),
        "<= 100000 val",
    ),
    "size.json": (many("[],", 10_000_000), "<= 1000000 bytes"),
    "digits.json": (many("9", 900_000, '{"body": ', "}"), "must be a mapping"),
    "float.json": (many("0", 4000, PARAM, "}]}]}}"), "Value: must be a finite number"),
    "deep.txt": (lambda: f"0 E c 0\n{DEEP}", "<= 1000 characters"),
    "chain.json": (lambda: json.dumps({"body": chain(2000)}), "nested too deeply"),
    "line.txt": (many(" 1", 450_000, "0 E c 0"), "<= 1000 characters"),
    "digits.txt": (many("9", 900, "0 E c 0\n\n\nc ", " c 1 1"), "a neuron's number"),
    "neurons.txt": (many("c simple\n", 90_000, "0 E c 0\n\n"), "10000 neurons"),
    "entities.xml": (lambda: f"{ENTITIES}<mujoco name='&j;'/>", "document type"),
    "deep.xml": (lambda: "<a>" * 4000 + "</a>" * 4000, "levels of nesting"),
    "elements.xml": (lambda: mjcf(world=GEOM * 49_000), "was edited"),
    "tags.xml": (lambda: mjcf(world=GEOM * 90_000), "<= 50000 tags"),
    "attributes.xml": (attributes, "has no text"),
    "heights.xml": (lambda: mjcf(HFIELD), "was edited"),
    "size.xml": (many("<a/>", 10_000_000), "<= 6000000 bytes"),
    "size.toml": (many("#\n", 10_000_000), "<= 1000000 bytes"),
    "deep.toml": (many("[", 19_000, "a = "), "nested too deeply"),
    "tables.toml": (many("[[islands]]\n", 80_000), "<= 20000 lists and tables"),
    "islands.toml": (many("[[islands]]\n", 1001, MINE), "list of length <= 1000"),
    "count.toml": (lambda: f"{MINE}[[islands]]\ncount = 1000000000", "number <= 10000"),
    "dotted.toml": (many("a.", 15_000, "", "b = 1"), "<= 16 parts"),
    "quoted.toml": (many("' '.", 15_000, "", "b = 1"), "<= 16 parts"),
    "digits.toml": (many("9", 900_000, "births = "), "<= 1000 digits"),
    "hex.toml": (many("f", 900_000, "births = 0x"), "<= 1000 digits"),
    "count64.toml": (many("f", 900, f"{MINE}births = 0x"), "births: must be"),
    "float.toml": (lambda: f"{MINE}[simulation]\ngravity = 1e999999", "be finite"),
    "word.toml": (many("A", 900_000, f"{MINE}brain.type = '", "'"), "must be one of"),
    "copies.toml": (lambda: scenery(COPIES), "whole number <= 10000"),
    "nested.toml": (lambda: scenery(NESTED), "<= 10000 elements, copies included"),
    "entities.toml": (lambda: scenery(GEOM, ENTITIES), "document type"),
    "bodies.toml": (lambda: scenery(f"{'<body>' * 200}{'</body>' * 200}"), "<= 100 le"),
    "ground.toml": (lambda: f"{MINE}[environment]\n{STEEP}", "patch_m: must be >="),
    "user.toml": (lambda: scenery(f'<geom user="{"1 " * 400_000}"/>'), "user=...> is"),
}


@pytest.fixture(scope="module")
def outcomes(
    tmp_path_factory: pytest.TempPathFactory,
) -> dict[str, tuple[float, float, str]]:
    """Return memory [MB], CPU time [s] and error of each bomb, by its name."""
    folder = tmp_path_factory.mktemp("bombs")
    for name, (text, _) in BOMBS.items():
        (folder / name).write_text(text())
    done = subprocess.run(
        [sys.executable, "-c", READ_ALL, *(str(folder / name) for name in BOMBS)],
        capture_output=True,
        text=True,
        check=False,
    )
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    return {name: (memory, time, error) for name, memory, time, error in lines}


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(BOMBS))
def test_bomb_is_refused_in_one_short_line_before_it_costs_much(
    name: str, outcomes: dict[str, tuple[float, float, str]]
) -> None:
    assert name in outcomes, "it raised an error that is not for users"
    memory_mb, took_s, error = outcomes[name]
    assert re.search(BOMBS[name][1], error), error
    assert "\n" not in error
    assert len(error) < 1000
    assert memory_mb < MOST_MB
    assert took_s < MOST_S


def test_mjcf_that_reads_another_file_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "other.xml"
    # Opening it for reading would never return.
    os.mkfifo(other)
    path = tmp_path / "robot.xml"
    path.write_text(mjcf(f'<include file="{other}"/>'))
    with pytest.raises(InvalidRobot, match=r"robot\.xml: was edited"):
        read_robot(path)
