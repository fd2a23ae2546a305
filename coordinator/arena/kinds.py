"""Kind of plug-ins that decide who lives in an arena."""

from functools import partial

from coordinator.arena.check_rules import check_rules
from coordinator.arena.rules import BUILT_IN, METHODS, WHERE, load_rules
from schema.experiment.document import ArenaSection, Experiment, island_experiments
from schema.experiment.kinds import Kind, is_class

RULES = Kind(
    "rules",
    WHERE,
    BUILT_IN,
    is_one=partial(is_class, METHODS),
    section=lambda path: Experiment("by hand", arena=ArenaSection(rules=path)),
    sections=lambda whole: [at for at in island_experiments(whole) if at.arena],
    path=lambda experiment: experiment.arena.rules if experiment.arena else "",
    load=lambda experiment: load_rules(experiment)[0],
    check=check_rules,
)
"""``arena.rules``."""
