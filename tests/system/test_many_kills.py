"""Repeatability after many kills of coordinators and workers.

The environment variable REVOLVE_KILLS is the number of kills of each role in the long
tests; default: 1000.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from schema.tables.files import read_table
from tests.system.documents import (
    ARENAS,
    BRIDGE,
    CROWDED_ARENA,
    DIVERSE,
    LEARNING,
    MIXED,
    OFF_LINE,
    POND,
    PONDS,
    RING,
    SEASONS,
)

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
]

ROOT = Path(__file__).parents[2]
KILLING = Path(__file__).with_name("killing.py")
DOCUMENTS = {
    "off": OFF_LINE,
    "bridge": BRIDGE,
    "arena": SEASONS,
    "mixed": MIXED,
    "learning": LEARNING,
    "crowd": CROWDED_ARENA,
    "ring": RING,
    "diverse": DIVERSE,
    "arenas": ARENAS,
    "pond": POND,
    "ponds": PONDS,
}
KILLS = int(os.environ.get("REVOLVE_KILLS", "1000"))
OF_COORDINATORS = {"instants": 0.7, "fleet": 0.3}
"""Shares of the kills of coordinators."""
ENOUGH = 500
"""Kills of coordinators that hit instants of all kinds."""
OFTEN_HIT = {
    "write journal.bin",
    "write .arrows",
    "write .sums",
    "write .epoch.new",
    "replace epoch",
    "write_table .parquet.new",
    "digest_of .parquet.new",
    "seal",
    "replace run.json",
    "replace .parquet",
    "unlink .arrows",
    "unlink .sums",
    "write poses.arrows",
    "write poses.sums",
    "restore",
}
"""Instants that are certain to be hit, whatever the kills of each document."""


def killed(folder: Path, mode: str, kills: tuple[int, int], seed: int) -> Any:  # noqa: ANN401 - JSON
    """Run the program that kills on all documents in a folder; return its results."""
    done = subprocess.run(
        [
            sys.executable, str(KILLING), mode, *map(str, kills), str(seed),
            *sorted(path.name for path in folder.glob("*.toml")),
        ],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )  # fmt: skip
    sys.stdout.write(done.stdout)
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mode", "kinds", "kills"),
    [
        ("instants", ("bridge", "arena", "crowd", "diverse"), (30, 0)),
        ("fleet", ("off", "bridge", "learning", "mixed"), (8, 24)),
    ],
)
def test_kills_in_runs_of_all_kinds_give_equal_runs(
    tmp_path: Path, mode: str, kinds: tuple[str, ...], kills: tuple[int, int]
) -> None:
    for kind in kinds:
        (tmp_path / f"{kind}.toml").write_text(DOCUMENTS[kind])
    results = killed(tmp_path, mode, kills, seed=51)
    assert results["differences"] == []
    assert sum(results["kills"].values()) == sum(kills)
    assert len(results["per_run"]) >= len(kinds)


@pytest.mark.long
@pytest.mark.timeout(4 * 3600)
@pytest.mark.parametrize("mode", OF_COORDINATORS)
def test_many_kills_give_equal_runs(tmp_path: Path, mode: str) -> None:
    for kind, document in DOCUMENTS.items():
        (tmp_path / f"{kind}.toml").write_text(document)
    of_coordinators = round(KILLS * OF_COORDINATORS[mode])
    of_workers = KILLS if mode == "fleet" else 0
    results = killed(tmp_path, mode, (of_coordinators, of_workers), seed=60)
    assert results["differences"] == []
    assert sum(results["kills"].values()) == of_coordinators + of_workers
    migrants = read_table(tmp_path / "arenas", "migrations").num_rows
    reasons = read_table(tmp_path / "arenas", "deaths")["reason"].to_pylist()
    assert reasons.count("migrated") == migrants > 2
    assert read_table(tmp_path / "ring", "migrations").num_rows == 8 * 2 * 2
    if mode == "instants" and KILLS >= ENOUGH:
        assert set(results["kills"]) >= OFTEN_HIT
