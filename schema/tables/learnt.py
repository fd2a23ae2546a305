"""Brains that robots learnt: those of arenas in the births table, and best trials."""

import pyarrow as pa
import pyarrow.compute as pc

from schema.robot.ids import BirthId


def with_learnt(births: pa.Table, learning: pa.Table) -> pa.Table:
    """Return births whose column ``robot`` has what robots of arenas have learnt.

    An arena writes the births row first, and the table ``learning`` when the robot has
    grown up. Off-line births have what was learnt already. Of births, the columns
    ``island``, ``birth`` and ``robot`` are needed.
    """
    grown = learning.filter(pc.is_valid(learning["robot"]))
    if not grown.num_rows:
        return births
    columns = (grown[name].to_pylist() for name in ("island", "birth", "robot"))
    learnt = {
        (island, birth): robot for island, birth, robot in zip(*columns, strict=True)
    }
    columns = (births[name].to_pylist() for name in ("island", "birth", "robot"))
    robots = [
        learnt.get((island, birth), robot)
        for island, birth, robot in zip(*columns, strict=True)
    ]
    index = births.schema.get_field_index("robot")
    field = births.schema.field(index)
    return births.set_column(index, field, pa.array(robots, field.type))


def best_trials(learning: pa.Table) -> dict[BirthId, int]:
    """Return the number of each robot's best trial; of equal ones the first.

    Robots whose trials all failed are left out. The evaluations row of a robot that
    learnt off-line has number 0 in place of this one.
    """
    judged = learning.filter(pc.is_valid(learning["fitness"]))
    judged = judged.sort_by([("fitness", "descending"), ("trial", "ascending")])
    best: dict[BirthId, int] = {}
    for row in judged.select(["island", "birth", "trial"]).to_pylist():
        best.setdefault(BirthId(row["island"], row["birth"]), row["trial"])
    return best
