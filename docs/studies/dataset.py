"""Makes a data set of the robots and results of the campaign, with a card.

    python -m docs.studies.dataset FOLDER            # of docs/data
    python -m docs.studies.dataset FOLDER runs/mine  # and of finished runs

FOLDER gets three Parquet files and README.md, in the format of a data set's card. The
same rows give the same bytes.
"""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import pyarrow as pa
import yaml

from analysis.measures.load import read_runs
from analysis.measures.outputs import BODY, OUTCOME
from docs.studies.thesis.data import DATA, kept, parquet, replace
from docs.studies.thesis.rows import measured_rows
from schema.agent.version import VERSION
from schema.experiment.brains import neuron_kinds
from schema.experiment.document import Experiment, body_space
from schema.experiment.file import experiment_from_text
from schema.formats.yaml import robot_to_yaml
from schema.wire.born import robot_of_birth

FILES = {"robots": "final", "runs": "runs", "outcomes": "outcomes"}
"""Table of docs/data of each file."""
CAMPAIGN = "campaign"
"""Source of the rows of docs/data."""
ONE_RUN = {
    "source": f"`{CAMPAIGN}` of docs/data, or folder that was given",
    "experiment": "name of the experiment",
    "run": "number of the repeat, from 0",
}
COLUMNS = {
    "robots": {
        **ONE_RUN,
        "birth": "number of the birth in its run; founders come first",
        "parents": "births of the parents; empty for a random robot",
        "fitness": "last fitness; in the campaign path velocity + 5 x straight "
        "velocity over 12 s [m/s]",
        "rank": "1 for a robot without parents, else 1 + the greatest of the parents",
        "ancestors": "number of different ancestors",
        **BODY,
        "genome": "genome, Protobuf message `Genome` of `schema/wire/revolve.proto`",
        "robot": "body and brain of the genome as YAML, which `revolve robot` reads",
    },
    "runs": {
        **ONE_RUN,
        "seed": "random seed",
        "births": "number of births of all islands",
        "state": "all are finished",
        "platform": "CPU class, C library, MuJoCo and NumPy; equal ones compute alike",
        "versions": "versions of all libraries",
        "commit": "commit of the code that began the campaign; null of other runs",
        "document": "all settings of the experiment, as JSON",
    },
    "outcomes": {**ONE_RUN, **OUTCOME, "births": "births at which these were measured"},
}
TEXT = """
# Robots of Revolve Islands

Modular robots, bodies and brains, that evolved in the campaign of Revolve Islands. It
repeats the experiments of Elte Hupkes, *Revolve: An Evolutionary Robotics Toolkit*,
2016: three ways to evolve (`scenario1`: 15 parents and 15 children; `scenario2`: one
child at a time; `scenario3`: robots share an arena) and two baselines (`no-selection`,
`no-reproduction`: random search). `robots` has the last population of each run.

## How it was made

Robots were simulated in MuJoCo for 12 s on flat ground. `run` selects the random
streams of a seed. `python -m docs.studies.dataset FOLDER` of version {version} of the
project wrote the files; its docs/results.md describes the campaign.

| source | experiment | runs | births of a run |
|---|---|---|---|
{made}

## How to read it

    import datasets
    robots = datasets.load_dataset("FOLDER", "robots", split="train")

    import duckdb
    query = "select experiment, max(fitness) from 'FOLDER/robots.parquet' group by all"
    duckdb.sql(query)

    import revolve as rv
    Path("robot.yaml").write_text(robots[0]["robot"])
    rv.evaluate(rv.Robot.read("robot.yaml"), "scenario1").fitness  # that of the row

A run is identified by `source`, `experiment` and `run` in all files.

## Limits

All robots are of one simulator, with the friction, servos and contacts of the project's
docs/physics.md; none was built. The fitness of `scenario3` is that of robots that meet
others.

## Licence and citation

Apache-2.0. Please cite the project (CITATION.cff) and the thesis.
"""


def tables(folders: Sequence[Path] = (), data: Path = DATA) -> dict[str, pa.Table]:
    """Return the rows of each file: of docs/data, and of finished runs in folders."""
    found: dict[str, list[pa.Table]] = {name: [] for name in FILES}
    for name, table in FILES.items():
        found[name].append(_named(kept(data, table).drop_columns("folder"), CAMPAIGN))
    for folder in folders:
        for run in read_runs([folder])[0]:
            if run.is_finished:
                rows = measured_rows(run, None)
                for name, table in FILES.items():
                    found[name].append(_named(rows[table], folder.name))
    whole = {
        name: pa.concat_tables(pieces, promote_options="default")
        for name, pieces in found.items()
    }
    robots = [*_robots(whole["robots"], whole["runs"])]
    whole["robots"] = whole["robots"].append_column("robot", pa.array(robots))
    return {
        name: table.select([key for key in COLUMNS[name] if key in table.column_names])
        for name, table in whole.items()
    }


def _named(rows: pa.Table, source: str) -> pa.Table:
    return rows.append_column("source", pa.repeat(source, rows.num_rows))


def _robots(rows: pa.Table, runs: pa.Table) -> Iterator[str]:
    """Yield the YAML text of each robot."""
    experiments: dict[tuple[str, ...], Experiment] = {
        tuple(row[key] for key in ONE_RUN): experiment_from_text(
            row["document"], is_own=True
        )
        for row in runs.select([*ONE_RUN, "document"]).to_pylist()
    }
    for row in rows.select([*ONE_RUN, "genome"]).to_pylist():
        experiment = experiments[tuple(row[key] for key in ONE_RUN)]
        robot = robot_of_birth(row["genome"], None, experiment)
        kinds = neuron_kinds(experiment.brain, experiment.space)
        yield robot_to_yaml(robot, body_space(experiment.space), kinds)


def card(rows: dict[str, pa.Table]) -> str:
    """Return README.md of the data set: front matter, text, columns."""
    head = {
        "license": "apache-2.0",
        "pretty_name": "Robots of Revolve Islands",
        "tags": ["evolutionary robotics", "modular robots", "mujoco"],
        "size_categories": ["1K<n<10K"],
        "configs": [
            {"config_name": name, "data_files": f"{name}.parquet",
             **({"default": True} if name == "robots" else {})}
            for name in FILES
        ],
    }  # fmt: skip
    runs = rows["runs"]
    counts = runs.group_by(["source", "experiment"], use_threads=False).aggregate(
        [("run", "count"), ("births", "max")]
    )
    made = (f"| {' | '.join(map(str, row.values()))} |" for row in counts.to_pylist())
    text = TEXT.format(made="\n".join(made), version=VERSION)
    lines = ["---", yaml.safe_dump(head, sort_keys=False).rstrip(), "---", text]
    for name, table in rows.items():
        lines += [f"## Columns of `{name}.parquet`", "", "| column | type | meaning |"]
        lines += ["|---|---|---|"]
        for field in table.schema:
            meaning = COLUMNS[name][field.name]
            lines.append(f"| `{field.name}` | {field.type} | {meaning} |")
        lines.append("")
    return "\n".join(lines)


def write(folder: Path, folders: Sequence[Path] = (), data: Path = DATA) -> None:
    """Write the data set to a folder."""
    rows = tables(folders, data)
    for name, table in rows.items():
        replace(folder / f"{name}.parquet", parquet(table))
        print(f"{folder / name}.parquet: {table.num_rows} rows")
    replace(folder / "README.md", card(rows).encode())


def main() -> None:
    """Write the data set that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder to write to")
    parser.add_argument("runs", type=Path, nargs="*", help="folders of runs")
    options = parser.parse_args()
    write(options.out, options.runs)


if __name__ == "__main__":
    main()
