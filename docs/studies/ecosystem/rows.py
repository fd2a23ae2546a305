"""Rows of a finished run of the study of the ecosystem."""

from collections import Counter, defaultdict
from collections.abc import Mapping
from typing import Any

import msgspec
import numpy as np

import revolve as rv
from coordinator.arena.ecosystem import Ecosystem

LAST_S = 600.0
"""Time before the end over which populations are averaged [s]."""
SAMPLE_S = 60.0
"""Time between rows of courses [s]."""
DECISION_S, TINY = 1.0, 1e-6
"""Time between decisions of the rules [s]."""
Row = dict[str, Any]
Frame = Any  # pandas has no types


def sizes(run: rv.Run) -> tuple[Any, Any]:
    """Return the times at which the population changes [s], and its sizes from then."""
    changes: Counter[float] = Counter()
    for table, step in ((run.births, 1), (run.deaths, -1)):
        for time_s in table["sim_time_s"].to_pylist():
            changes[time_s] += step
    times = np.array(sorted(changes))
    return times, np.cumsum([changes[time_s] for time_s in times])


def mean_over(times: Any, values: Any, start: float, end: float) -> float:  # noqa: ANN401
    """Return the mean of a step function between two times."""
    edges = np.concatenate([[start], times[(times > start) & (times < end)], [end]])
    held = values[np.searchsorted(times, edges[:-1], side="right") - 1]
    return float(np.sum(held * np.diff(edges)) / (end - start))


def run_row(run: rv.Run) -> Row:
    """Return what became of the population of a run."""
    arena = run.experiment.settings["arena"]
    end_s, limit = arena["end_s"], arena["population_limit"]
    times, living = sizes(run)
    reasons = Counter(run.deaths["reason"].to_pylist())
    extinct_s = float(times[-1]) if living[-1] == 0 else None
    outcomes = Counter(run.matings["outcome"].to_pylist())
    return {
        "end_s": end_s,
        "survived_s": end_s if extinct_s is None else extinct_s,
        "is_extinct": int(extinct_s is not None),
        "population": round(mean_over(times, living, end_s - LAST_S, end_s), 3),
        "at_limit": round(mean_over(times, living >= limit, 0.0, end_s), 4),
        "at_limit_late": round(
            mean_over(times, living >= limit, end_s - LAST_S, end_s), 4
        ),
        "children": outcomes["born"],
        "no_room": outcomes["no room"],
        "died_energy": reasons["no energy"],
        "died_age": reasons["age"],
        "died_other": sum(reasons.values()) - reasons["no energy"] - reasons["age"],
    }


def course_rows(run: rv.Run) -> list[Row]:
    """Return population, energy and children of a run at some times."""
    end_s = run.experiment.settings["arena"]["end_s"]
    times, living = sizes(run)
    fitness, births = run.fitness.to_pandas(), run.births.to_pandas()
    energy = fitness["stores"].map(lambda stores: dict(stores)["energy"])
    mean = energy.groupby(fitness["sim_time_s"]).mean()
    born = births["sim_time_s"][births["parents"].map(len) > 0].to_numpy()
    rows = []
    for time_s in np.arange(SAMPLE_S, end_s + SAMPLE_S / 2, SAMPLE_S):
        recent = mean[(mean.index > time_s - SAMPLE_S) & (mean.index <= time_s)]
        size = mean_over(times, living, time_s - SAMPLE_S, time_s)
        rows.append(
            {
                "sim_time_s": time_s,
                "population": round(size, 3),
                "energy": round(float(recent.mean()), 3) if len(recent) else "",
                "children": int((born <= time_s).sum()),
            }
        )
    return rows


def robot_rows(run: rv.Run) -> list[Row]:
    """Return what each robot of a run did; without those that have no sample."""
    given = run.experiment.settings["arena"]["parameters"]
    shared = {
        name: given[name] for name in given.keys() & set(Ecosystem.__struct_fields__)
    }
    rules = msgspec.to_builtins(Ecosystem(**shared))
    births = run.births.to_pandas().set_index("birth")
    deaths = run.deaths.to_pandas().set_index("birth")
    matings = run.matings.to_pandas()
    within, children = in_patches(run), Counter[int]()
    costs: defaultdict[int, float] = defaultdict(float)
    samples = run.fitness.to_pandas()
    last_s = samples.groupby("birth")["sim_time_s"].max()
    for mating in matings.itertuples():
        for parent in mating.parents:
            birth, is_born = parent["birth"], mating.outcome == "born"
            children[birth] += is_born
            # A sample is before the decision at its time, a refund after a second.
            since_s = last_s.get(birth, 0.0) - mating.sim_time_s
            if since_s > 0:
                costs[birth] += rules["mating_cost"] - rules["mating_gain"]
                is_paid = is_born or since_s < DECISION_S + TINY
                costs[birth] += rules["child_energy"] / 2 if is_paid else 0.0
    rows = []
    for birth, lived in samples.groupby("birth"):
        own, last = births.loc[birth], lived.iloc[-1]
        start = rules["child_energy" if len(own["parents"]) else "start_energy"]
        spent = rules["energy_per_s"] * max(0.0, last["age_s"] - DECISION_S)
        spent += rules["energy_per_j"] * last["work_j"] + costs[birth]
        taken = dict(last["stores"])["energy"] - start + spent
        is_dead = birth in deaths.index
        rows.append(
            {
                "birth": birth,
                "is_founder": int(len(own["parents"]) == 0),
                "born_s": own["sim_time_s"],
                "age_s": round(last["age_s"], 3),
                "reason": deaths.loc[birth, "reason"] if is_dead else "",
                "rank": own["rank"],
                "parts": own["parts"],
                "motors": own["motors"],
                "intake_per_s": f"{taken / last['age_s']:.5g}" if last["age_s"] else "",
                "work_w": f"{last['work_j'] / last['age_s']:.5g}"
                if last["age_s"]
                else "",
                "path_velocity": f"{lived['path_velocity'].mean():.5g}",
                "straight_velocity": f"{lived['straight_velocity'].mean():.5g}",
                "in_patches": f"{within.get(birth, float('nan')):.4g}",
                "children": children[birth],
            }
        )
    return rows


def in_patches(run: rv.Run) -> Mapping[int, float]:
    """Return the share of the poses of each robot that are in a patch that is fixed."""
    patches = run.patches.to_pandas().drop_duplicates("patch")
    poses = run.table("poses").select(["birth", "x", "y"]).to_pandas()
    inside = np.zeros(len(poses), bool)
    for patch in patches.itertuples():
        away = np.hypot(poses["x"] - patch.x, poses["y"] - patch.y)
        inside |= (away <= patch.radius_m).to_numpy()
    return dict(poses.assign(inside=inside).groupby("birth")["inside"].mean())
