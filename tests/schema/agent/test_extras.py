"""Advice on installing an extra, for each way of installing the package."""

import json
import sys
from importlib.metadata import Distribution
from pathlib import Path

import pytest

from schema.agent import extras
from schema.agent.extras import install_advice

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
