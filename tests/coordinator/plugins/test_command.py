"""List of plug-ins: also what installed packages and their modules hold."""

import json
from pathlib import Path

import pytest

from coordinator.__main__ import main
from schema.plugins import permission

pytestmark = pytest.mark.usefixtures("_nothing_allowed")


def test_modules_inside_an_entry_point_are_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An entry point may name a package that imports what it offers."""
    package = tmp_path / "pointed_pack"
    (package / "inner").mkdir(parents=True)
    (package / "__init__.py").write_text("from .scores import far\n")
    (package / "inner" / "__init__.py").write_text("")
    text = "def {}(trace, parameters):\n    return 0.0\n"
    (package / "scores.py").write_text(text.format("far"))
    (package / "inner" / "more.py").write_text(text.format("near"))
    (package / "broken.py").write_text("1 / 0\n")
    meta = tmp_path / "pointed_pack-1.dist-info"
    meta.mkdir()
    (meta / "METADATA").write_text("Metadata-Version: 2.1\nName: pointed-pack\n")
    points = "[revolve.plugins]\nmine = pointed_pack\n"
    (meta / "entry_points.txt").write_text(points)
    monkeypatch.syspath_prepend(tmp_path)
    permission._installed_modules.cache_clear()
    try:
        assert main(["plugins", "--json"]) == 1
    finally:
        permission._installed_modules.cache_clear()
    rows = [
        (row["kind"], row["name"], row["defined"])
        for row in json.loads(capsys.readouterr().out)
        if row["name"].startswith("pointed_pack")
    ]
    (kind, name, why), *found = sorted(rows)
    assert found == [
        ("fitness", "pointed_pack.inner.more:near", "more.py:1"),
        ("fitness", "pointed_pack.scores:far", "scores.py:1"),
    ]
    assert (kind, name) == ("", "pointed_pack.broken")
    assert "ZeroDivisionError" in why
