"""Values of flags, and advice how to install what is missing."""

import json
import sys
from collections.abc import Callable
from importlib.metadata import Distribution
from pathlib import Path

import pytest

from schema.agent import extras
from schema.agent.extras import install_advice
from schema.agent.flags import Flags, number, positive_number, share, whole_number


def parsed(read: Callable[[str], float], text: str) -> float:
    flags = Flags(prog="revolve try")
    flags.add_argument("--value", type=read)
    value: float = flags.parse_args([f"--value={text}"]).value
    return value


@pytest.mark.parametrize(
    ("read", "text", "value"),
    [
        (whole_number(0), "0", 0),
        (whole_number(), "17", 17),
        (whole_number(16, 99), "99", 99),
        (number, "-2.5", -2.5),
        (positive_number, "1e-3", 1e-3),
        (share, "0", 0.0),
        (share, "1", 1.0),
    ],
)
def test_what_is_allowed(read: Callable[[str], float], text: str, value: float) -> None:
    assert parsed(read, text) == value


@pytest.mark.parametrize(
    ("read", "text", "what"),
    [
        (whole_number(0), "-1", "a whole number >= 0"),
        (whole_number(), "0", "a whole number >= 1"),
        (whole_number(), "1.5", "a whole number >= 1"),
        (whole_number(), "\u00b2", "a whole number >= 1"),
        (whole_number(16), "15", "a whole number >= 16"),
        (whole_number(16, 99), "100", "a whole number in 16..99"),
        (number, "inf", "a finite number"),
        (number, "five", "a finite number"),
        (positive_number, "0", "a finite number > 0"),
        (positive_number, "nan", "a finite number > 0"),
        (share, "1.01", "a number from 0 to 1"),
        (share, "-0.01", "a number from 0 to 1"),
    ],
)
def test_what_is_not(
    capsys: pytest.CaptureFixture[str],
    read: Callable[[str], float],
    text: str,
    what: str,
) -> None:
    with pytest.raises(SystemExit) as ended:
        parsed(read, text)
    said = capsys.readouterr().err
    assert ended.value.code == 2
    line = f"revolve try: argument --value: must be {what}, got {text!r} "
    assert said.splitlines() == [line + "(see revolve try --help)"]


PIP = f"{sys.executable} -m pip install"


class Installed:
    """Files of an installed package."""

    def __init__(self, **files: str) -> None:
        self._files = files

    def read_text(self, name: str) -> str | None:
        return self._files.get(name.partition(".")[0])


@pytest.mark.parametrize(
    ("source", "tool", "expected"),
    [
        (None, "pip\n", f"{PIP} 'revolve-islands[view]'"),
        (
            None,
            "uv",
            f"uv pip install --python {sys.executable} 'revolve-islands[view]'",
        ),
        ({"dir_info": {"editable": True}}, "pip", f"{PIP} -e '{{}}[view]'"),
        ({"dir_info": {}}, "pip", f"{PIP} '{{}}[view]'"),
        ({"archive_info": {"hash": "x"}}, "pip", f"{PIP} '{{}}[view]'"),
    ],
)
def test_advice_is_how_the_package_was_installed(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    source: dict[str, object] | None,
    tool: str,
    expected: str,
) -> None:
    place = tmp_path / "my lab"
    place.mkdir()
    files = {"INSTALLER": tool}
    if source is not None:
        files["direct_url"] = json.dumps({"url": place.as_uri(), **source})
    monkeypatch.setattr(extras, "distribution", lambda _name: Installed(**files))
    assert install_advice("view") == expected.format(place)


def test_a_lost_wheel_is_not_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lost = json.dumps({"url": (tmp_path / "a.whl").as_uri(), "archive_info": {}})
    found = Installed(direct_url=lost)
    monkeypatch.setattr(extras, "distribution", lambda _name: found)
    assert install_advice("all") == f"{PIP} 'revolve-islands[all]'"


def test_without_an_installed_package_the_name_is_advised(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(extras, "distribution", Distribution.from_name)
    monkeypatch.setattr(extras, "NAME", "no-such-package")
    assert install_advice("view") == "pip install 'no-such-package[view]'"
