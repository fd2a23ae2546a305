"""Packed robots: the same bytes for the same robot, and nothing else is read."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterable
from io import BytesIO
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np
import pytest

from schema.errors import ExperimentError, InvalidRobot, MalformedMessage, RevolveError
from schema.experiment.file import read_experiment
from schema.formats.files import read_robot, settings_of, types_for, write_robot
from schema.formats.packed import packed_robot
from schema.formats.run_settings import read_with_settings
from schema.limits import MOST_PLUGIN_BYTES
from schema.plugins import permission
from schema.plugins.permission import allow, import_allowed
from schema.robot.archive import RobotOrigin, archive_bytes, read_archive
from schema.robot.ids import BirthId
from tests.documents import parse_experiment
from tests.schema.formats.test_bombs import MOST_MB, MOST_S, READ_ALL
from tests.schema.robots import robot_of

pytestmark = pytest.mark.usefixtures("_nothing_allowed")

ORIGIN = RobotOrigin("ab12", BirthId(1, 17), (BirthId(1, 3), BirthId(0, 9)), 0.25)
MEMBERS = [
    "contents.json", "robot.yaml", "robot.pb", "experiment.json", "picture.png"
]  # fmt: skip


@pytest.fixture(autouse=True)
def _no_copies(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(permission, "_copies", {})


def packed() -> bytes:
    return packed_robot(robot_of(), read_experiment("scenario1"), b"png", ORIGIN)


def members(data: bytes) -> dict[str, bytes]:
    with ZipFile(BytesIO(data)) as file:
        return {name: file.read(name) for name in file.namelist()}


def zipped(entries: Iterable[tuple[str, bytes]], method: int = 0) -> bytes:
    """Return a zip as another tool writes it."""
    file = BytesIO()
    with ZipFile(file, "w", method) as archive:
        for name, data in entries:
            archive.writestr(ZipInfo(name), data, method)
    return file.getvalue()


def with_member(name: str, data: bytes) -> Callable[[], bytes]:
    return lambda: zipped({**members(packed()), name: data}.items())


def with_settings(text: str) -> Callable[[], bytes]:
    """Return a packed robot with other settings that fit its digests."""

    def made() -> bytes:
        rest = dict(list(members(packed()).items())[1:])
        return archive_bytes({**rest, "experiment.json": text.encode()}, {}, None)

    return made


def test_the_same_robot_has_the_same_bytes_and_is_read_again(tmp_path: Path) -> None:
    file = tmp_path / "some.robot"
    file.write_bytes(packed())
    assert packed() == packed()
    assert [*members(packed())] == MEMBERS
    assert read_archive(file)[0].origin == ORIGIN
    said: list[str] = []
    robot, settings, experiment = read_with_settings(file, None, say=said.append)
    assert said == [f"with the settings in {file}; --experiment names others"]
    assert (robot, experiment) == (robot_of(), read_experiment("scenario1"))
    assert settings == settings_of(experiment)
    # Its parts are readable without this project.
    for name in ("robot.yaml", "robot.pb"):
        (tmp_path / name).write_bytes(members(packed())[name])
        assert read_robot(tmp_path / name, *types_for(settings)) == robot
    assert json.loads(members(packed())["experiment.json"])["name"] == "scenario1"


def test_named_settings_precede_those_in_the_file(tmp_path: Path) -> None:
    file = tmp_path / "some.robot"
    file.write_bytes(packed())
    _, settings, experiment = read_with_settings(file, "scenario2")
    assert experiment == read_experiment("scenario2")
    assert settings == settings_of(experiment)


OWN = '{"name": "x", "fitness": {"function": "missing_lab:judge"}}'
MISTAKES: dict[str, tuple[Callable[[], bytes], str]] = {
    "empty": (lambda: b"", "not a packed robot: File is not a zip file"),
    "text": (lambda: b"body: {}", "not a packed robot: File is not a zip file"),
    "truncated": (lambda: packed()[:-30], "not a packed robot: File is not a zip file"),
    "flipped": (
        lambda: packed().replace(b"type: Core", b"type: Cora"),
        "not a packed robot: Bad CRC-32 for file 'robot.yaml'",
    ),
    "edited": (with_member("robot.yaml", b"body: {}"), "was changed after it was pack"),
    "replaced": (with_member("contents.json", b"{}"), "must have a key 'revolve_robot"),
    "version": (
        with_member("contents.json", b'{"revolve_robot":2,"digests":{}}'),
        "not a packed robot: Invalid enum value 2 - at `$.revolve_robot`",
    ),
    "missing": (
        lambda: zipped(list(members(packed()).items())[:-1]),
        "was changed after it was packed: pack the robot again",
    ),
    "twice": (
        lambda: zipped([*members(packed()).items(), ("robot.pb", b"")]),
        "was changed after it was packed",
    ),
    "other": (with_member("notes.txt", b""), "member 'notes.txt': must be contents.j"),
    "outside": (with_member("plugins/../../x.py", b""), "member 'plugins/../../x.py'"),
    "absolute": (with_member("/etc/passwd", b""), "member '/etc/passwd': must be con"),
    "compressed": (
        lambda: zipped(members(packed()).items(), ZIP_DEFLATED),
        "its members must not be compressed or share bytes",
    ),
    "settings": (with_settings("{}"), "experiment.json: experiment of a run: "),
    "nested": (with_settings("[" * 30_000), "<= 20000 lists and tables, got 30000"),
    "own": (with_settings(OWN), "plug-in missing_lab: is not allowed, but "),
}


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("name", MISTAKES)
def test_another_file_is_refused_in_one_line(name: str, tmp_path: Path) -> None:
    file = tmp_path / f"{name}.robot"
    file.write_bytes(MISTAKES[name][0]())
    with pytest.raises((InvalidRobot, ExperimentError)) as refused:
        read_with_settings(file, None)
    assert MISTAKES[name][1] in str(refused.value)
    assert str(file) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_mistakes_with_flags_are_one_line(tmp_path: Path) -> None:
    file = tmp_path / "some.robot"
    file.write_bytes(packed())
    with pytest.raises(ExperimentError, match=r"--island must be in 0\.\.0, got 1"):
        read_with_settings(file, None, 1)
    with pytest.raises(InvalidRobot, match=r"got '\.robot' \(robot pack writes it\)"):
        write_robot(robot_of(), tmp_path / "other.robot")
    with pytest.raises(InvalidRobot, match=r"gone\.robot: cannot be read: No such"):
        allow([str(tmp_path / "gone.robot")])


def test_any_changed_bit_is_refused_or_changes_nothing(tmp_path: Path) -> None:
    file, data = tmp_path / "some.robot", packed()
    refused = 0
    for at in np.random.default_rng(1).integers(len(data) * 8, size=300).tolist():
        changed = bytearray(data)
        changed[at // 8] ^= 1 << at % 8
        file.write_bytes(changed)
        try:
            robot, _, experiment = read_with_settings(file, None, say=lambda _: None)
        except (InvalidRobot, MalformedMessage):
            refused += 1
        else:
            assert (robot, experiment) == (robot_of(), read_experiment("scenario1"))
    assert refused > 200


def entries() -> bytes:
    """Return a zip with as many members as fit."""
    data = bytearray(zipped([("a", b"")]))
    at = data.index(b"PK\x01\x02")
    entry = bytes(data[at : data.index(b"PK\x05\x06")])
    return bytes(data[:at]) + entry * (7_900_000 // len(entry)) + bytes(data[-22:])


BOMBS: dict[str, tuple[Callable[[], bytes], str]] = {
    "size.robot": (lambda: b"PK" * 10_000_000, "must have <= 8388608 bytes"),
    "entries.robot": (entries, "must have <= 2000 members, got 168"),
    "zeros.robot": (
        lambda: zipped([("robot.pb", bytes(10**8))], ZIP_DEFLATED),
        "must not be compressed",
    ),
    "list.robot": (
        lambda: zipped([("contents.json", b"[],".join([b""] * 2_700_000))]),
        "not a packed robot",
    ),
}


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_bombs_are_refused_before_they_cost_much(tmp_path: Path) -> None:
    for name, (made, _) in BOMBS.items():
        (tmp_path / name).write_bytes(made())
    words = [str(tmp_path / name) for name in BOMBS]
    told = subprocess.check_output([sys.executable, "-c", READ_ALL, *words], text=True)
    outcomes = [json.loads(line) for line in told.splitlines()]
    assert [name for name, *_ in outcomes] == [*BOMBS]
    for name, memory_mb, took_s, error in outcomes:
        assert BOMBS[name][1] in error
        assert memory_mb < MOST_MB, name
        assert took_s < MOST_S, name


LAB = """
from pathlib import Path
NUMBERS = Path(__file__).with_name("numbers.txt").read_text()
def judge(trace):
    return {}
"""


def lab(source: Path, number: object, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a packed robot with a plug-in and its data file, which are gone."""
    source.parent.mkdir(exist_ok=True)
    source.write_text(LAB.format(number))
    source.with_name("numbers.txt").write_text("12")
    is_package = source.stem == "__init__"
    name = source.parent.name if is_package else source.stem
    text = f'name = "x"\n[fitness]\nfunction = "{name}:judge"\n'
    file = source.with_suffix(".robot")
    with monkeypatch.context() as only:
        only.setattr(permission, "_allowed", {})
        only.setattr(permission, "_copies", {})
        allow([f"{name}={source.parent}" if is_package else str(source)])
        document = parse_experiment(text, str(source.with_name("x.toml")))
        file.write_bytes(packed_robot(robot_of(), document, b"", None))
    source.unlink()
    return file


@pytest.mark.parametrize("path", ["packed_lab/__init__.py", "packed_file.py"])
def test_code_is_imported_only_if_it_is_allowed(
    path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = lab(tmp_path / path, 1.0, monkeypatch)
    name = path.partition("/")[0].removesuffix(".py")
    with pytest.raises(ExperimentError, match=f"{name}: is not allowed, .*{file} "):
        read_with_settings(file, None)
    assert name not in sys.modules
    allow(str(file))
    allow([str(file)])  # is not in use as another source
    assert read_with_settings(file, None)[2] is not None
    assert import_allowed(name).NUMBERS == "12"


def test_a_large_plug_in_is_not_in_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "packed_large.py"
    file = lab(source, f'"{"x" * MOST_PLUGIN_BYTES}"', monkeypatch)
    assert [*members(file.read_bytes())] == MEMBERS
    rule = "install that version, which is not in it, and add --plugins packed_large"
    with pytest.raises(ExperimentError, match=rule):
        read_with_settings(file, None)
    source.write_text(LAB.format(f'"{"x" * MOST_PLUGIN_BYTES}"'))
    allow([str(source)])
    assert read_with_settings(file, None)[2] is not None


def test_other_code_of_the_same_name_is_not_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = [
        lab(tmp_path / str(number) / "packed_other.py", number, monkeypatch)
        for number in range(2)
    ]
    allow([str(files[0])])
    with pytest.raises(ExperimentError, match=r"has source digest [0-9a-f]{12}, but"):
        read_with_settings(files[1], None)
    with pytest.raises(RevolveError, match="is in use"):
        allow([str(files[1])])
