"""Ecosystems: recomputed from their tables, equal with kills, longer, on islands."""

import shutil
from collections import defaultdict
from collections.abc import Iterator
from math import dist, hypot
from pathlib import Path
from typing import Any

import pytest

from coordinator.arena.ecosystem import Ecosystem
from coordinator.storage.compare import compare
from schema.tables.files import read_table
from tests.system.documents import POND, POND_RULES, PONDS
from tests.system.fleet import kill_beyond, size
from tests.system.workspace import Workspace

pytestmark = pytest.mark.system

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
ALONE = ("--in-process", "--quiet")
Pair = tuple[int, int]


@pytest.mark.parametrize(
    ("document", "before", "births"),
    [
        pytest.param(POND, 18, 28, id="ecosystem"),
        pytest.param(PONDS, 22, 30, id="ring of two"),
        pytest.param((EXAMPLES / "predators.toml").read_text(), 20, 40, id="predators"),
    ],
)
def test_run_is_equal_with_kills_on_two_workers_and_lengthened(
    workspace: Workspace, document: str, before: int, births: int
) -> None:
    shutil.copy(EXAMPLES / "predators.py", workspace.folder)
    wanted = workspace.finished(document, births, "wanted")
    killed = workspace.finished(document, before, "killed")
    shorter = size(killed)
    words: tuple[str, ...] = ("resume", "killed", "--births", str(births))
    for share in (0.3, 0.7):
        process = workspace.start(*words, "--quiet", "--workers", "2")
        kill_beyond(process, killed, shorter + share * (size(wanted) - shorter))
        words = ("resume", "killed")
    workspace.run("resume", "killed", *ALONE)
    assert compare(wanted, killed) == []
    assert read_table(wanted, "matings").num_rows > 4


class Tables:
    """Tables of an arena, by time and by birth."""

    def __init__(self, run: Path) -> None:
        self.robots = self._by_time(run, "fitness")
        self.patches = self._by_time(run, "patches")
        self.matings = self._by_time(run, "matings")
        self.deaths = self._by_time(run, "deaths")
        self.meetings = self._by_time(run, "meetings")
        self.poses = self._by_time(run, "poses")

    @staticmethod
    def _by_time(run: Path, name: str) -> dict[float, list[dict[str, Any]]]:
        rows: dict[float, list[dict[str, Any]]] = defaultdict(list)
        for row in read_table(run, name).to_pylist():
            rows[round(row["sim_time_s"], 6)].append(row)
        return rows

    def energy(self, time_s: float, store: str = "energy") -> dict[int, float]:
        """Return a store of each robot before the decision at a time."""
        return {r["birth"]: dict(r["stores"])[store] for r in self.robots[time_s]}

    def places(self, begin_s: float, end_s: float) -> Iterator[dict[int, Any]]:
        """Yield the places of robots at each sample of poses, by birth."""
        for time_s in sorted(self.poses):
            if begin_s < time_s <= end_s:
                yield {r["birth"]: (r["x"], r["y"]) for r in self.poses[time_s]}


class Second:
    """Second implementation of an ecosystem, which reads tables only."""

    def __init__(self, tables: Tables, rules: Ecosystem) -> None:
        self.tables, self.rules = tables, rules
        self.together_s: dict[Pair, float] = {}
        self.unborn: list[int] = []
        self.work_j: dict[int, float] = defaultdict(float)

    def decide(self, before_s: float, time_s: float) -> dict[int, float]:
        """Check a decision; return the energy of the robots that live on."""
        rules, tables, over_s = self.rules, self.tables, time_s - before_s
        energy = tables.energy(time_s)
        places = list(tables.places(before_s, time_s))
        ages = {row["birth"]: row["age_s"] for row in tables.robots[time_s]}
        # Before the first decision founders are born one after the other.
        lived_s = {birth: min(over_s, age_s) for birth, age_s in ages.items()}
        for birth in self.unborn:
            energy[birth] += rules.child_energy / 2 if birth in energy else 0.0
        for patch in tables.patches[time_s]:
            self.feed(patch, lived_s, energy, places, over_s)
        for row in tables.robots[time_s]:
            birth, work_j = row["birth"], row["work_j"]
            used_j = work_j - self.work_j[birth]
            energy[birth] -= rules.energy_per_s * lived_s[birth]
            energy[birth] -= rules.energy_per_j * used_j
            self.work_j[birth] = work_j
        dead = {
            birth: "age" if energy[birth] > 0 else "no energy"
            for birth in energy
            if energy[birth] <= 0 or ages[birth] >= rules.lifespan_s
        }
        reported = [row for row in tables.deaths[time_s] if row["reason"] != "diverged"]
        assert {row["birth"]: row["reason"] for row in reported} == dead
        lasting = {birth: has for birth, has in energy.items() if birth not in dead}
        self.mate(time_s, self.meet(time_s, energy, places), lasting, ages)
        return lasting

    def feed(
        self,
        patch: dict[str, Any],
        lived_s: dict[int, float],
        energy: dict[int, float],
        places: list[Any],
        over_s: float,
    ) -> None:
        """Add what each robot takes from a patch."""
        grown = patch["content"] + self.rules.patch_inflow * over_s
        left, wanted = min(grown, self.rules.patch_capacity), {}
        for birth in energy:
            away = [
                hypot(at[birth][0] - patch["x"], at[birth][1] - patch["y"])
                for at in places
                if birth in at
            ]
            inside = sum(each <= patch["radius_m"] for each in away)
            share = inside / len(away) if away else 0.0
            wanted[birth] = self.rules.intake_per_s * lived_s[birth] * share
        enough = left >= sum(wanted.values())
        for birth, most in wanted.items():
            energy[birth] += most if enough else most * left / sum(wanted.values())

    def meet(
        self, time_s: float, living: dict[int, float], places: list[Any]
    ) -> dict[Pair, float]:
        """Check the meetings; return their durations [s]."""
        near: dict[Pair, list[float]] = defaultdict(list)
        for at in places:
            for first in at:
                for second in at:
                    apart = dist(at[first], at[second])
                    if first < second and apart <= self.rules.mating_distance_m:
                        near[first, second].append(apart)
        wanted = {
            p: (0.2 * len(a), min(a)) for p, a in near.items() if {*p} <= {*living}
        }
        rows = self.tables.meetings[time_s]
        reported = {
            (row["birth"], row["other_birth"]): (row["duration_s"], row["nearest_m"])
            for row in rows
        }
        assert reported.keys() == wanted.keys()
        for pair, values in wanted.items():
            assert reported[pair] == pytest.approx(values, abs=1e-9)
        return {pair: duration_s for pair, (duration_s, _) in reported.items()}

    def mate(
        self,
        time_s: float,
        met_s: dict[Pair, float],
        energy: dict[int, float],
        ages: dict[int, float],
    ) -> None:
        """Check who mates; take the price from the parents."""
        rules, rests = self.rules, self.tables.energy(time_s, "rests_until_s")
        before, price = self.together_s, rules.child_energy / 2 + rules.mating_cost
        self.together_s = {p: before.get(p, 0.0) + s for p, s in met_s.items()}
        couples: list[list[int]] = []
        for pair in sorted(self.together_s, key=lambda p: (-self.together_s[p], p)):
            is_ready = all(
                birth in energy
                and ages[birth] >= rules.maturity_s
                and rests[birth] <= time_s
                and energy[birth] > price
                and not any(birth in couple for couple in couples)
                for birth in pair
            )
            if is_ready and self.together_s[pair] >= rules.mating_s:
                couples.append([*pair])
        for couple in couples:
            del self.together_s[couple[0], couple[1]]
            for birth in couple:
                energy[birth] += rules.mating_gain - price
        rows = self.tables.matings[time_s]
        reported = [[p["birth"] for p in row["parents"]] for row in rows]
        assert reported == couples
        self.unborn = [b for r in rows if r["birth"] is None for b in self.of(r)]

    @staticmethod
    def of(row: dict[str, Any]) -> list[int]:
        return [parent["birth"] for parent in row["parents"]]


def test_stores_meetings_matings_and_deaths_are_recomputed_from_tables(
    workspace: Workspace,
) -> None:
    run = workspace.finished(POND, 45, "a")
    keys = dict(line.split(" = ") for line in POND_RULES.splitlines())
    text = {"patch_motion"}
    given: Any = {k: v.strip('"') if k in text else float(v) for k, v in keys.items()}
    tables = Tables(run)
    second, compared = Second(tables, Ecosystem(**given)), 0
    times = sorted(tables.robots)
    for before_s, time_s, after_s in zip([0.0, *times], times, times[1:], strict=False):
        energy, after = second.decide(before_s, time_s), tables.energy(after_s)
        rests = tables.energy(after_s, "rests_until_s")
        mated = {b for row in tables.matings[time_s] for b in second.of(row)}
        for birth in energy.keys() & after.keys():
            assert after[birth] == pytest.approx(energy[birth], abs=1e-9), birth
            compared += 1
            if birth in mated:
                assert rests[birth] == time_s + second.rules.rest_s
        newborn = after.keys() - tables.energy(time_s).keys()
        assert {after[birth] for birth in newborn} <= {second.rules.child_energy}
    assert compared > 500
    reasons = {row["reason"] for rows in tables.deaths.values() for row in rows}
    assert reasons >= {"no energy"}
    assert sum(map(len, tables.matings.values())) > 10
