"""Analysis of one's own with polars: does size help, and which parents count?"""

import sys
import tempfile
from pathlib import Path

import polars as pl

import revolve as rv

with tempfile.TemporaryDirectory() as place:
    if len(sys.argv) > 1:
        run = rv.read(sys.argv[1])
    else:
        run = rv.run("scenario1", births=90, out=Path(place) / "run")
    births, evaluations = map(pl.DataFrame, (run.births, run.evaluations))

id_ = ["island", "birth"]
robots = births.join(evaluations.select(*id_, "fitness"), on=id_)
sizes = robots.group_by(pl.col("parts") // 5 * 5, maintain_order=True)
fitness = pl.col("fitness")
best = fitness.max().alias("best fitness")
print(sizes.agg(pl.len().alias("robots"), fitness.median(), best).sort("parts"))
relation = robots.select(pl.corr("parts", "fitness", method="spearman")).item()
print(f"correlation of parts and fitness: {relation:.3f}")

links = robots.select("birth", "fitness", "parents").explode("parents")
links = links.drop_nulls("parents").unnest("parents", separator=".")
by_parent = links.group_by("parents.birth")
print(by_parent.agg(pl.len().alias("children"), best).top_k(5, by="children"))
