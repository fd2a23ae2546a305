"""Experiments of a few seconds that several tests run, and the words of their runs."""

SCENARIO1 = ("scenario1", "--seed", "5", "--births", "60", "--quiet")
HAMLET = ("hamlet.toml", "--seed", "4", "--quiet")
CROWD = ("crowd.toml", "--seed", "4", "--quiet")
"""Runs of the fixtures ``undisturbed``, ``small_arena_run``, ``crowded_arena_run``."""

OFF_LINE = """
name = "singles"
births = 40
[selection]
population = 8
children = 8
[simulation]
window_steps = 400
[robust]
draws = 2
take = "least"
"""
"""Off-line island of short evaluations under drawn disturbances."""

BRIDGE = """
name = "short-bridge"
births = 24
[simulation]
window_steps = 400
evaluation_s = [2.0, 4.0]
[selection]
population = 8
children = 1
[selection.reevaluation]
interval = 3
share = 0.4
[selection.culling]
population_limit = 12
population_floor = 6
"""
"""Evaluations of 2 s to 4 s; a quarter of them are re-evaluations."""

SMALL_ARENA = """
name = "hamlet"
births = 12
[selection]
population = 5
[simulation]
warmup_steps = 200
window_steps = 800
[arena]
birth_interval_s = 4.0
cull_interval_s = 8.0
sample_interval_s = 2.0
snapshot_interval_s = 6.0
birth_radius_m = 0.4
record_touches = true
"""
"""Arena of little more than half a minute that covers all kinds of events."""

CROWDED_ARENA = """
name = "crowd"
births = 25
[selection]
population = 8
[simulation]
warmup_steps = 600
window_steps = 1200
[arena]
birth_interval_s = 4.0
cull_interval_s = 8.0
sample_interval_s = 2.0
snapshot_interval_s = 10.0
birth_radius_m = 0.5
record_touches = true
"""
"""Small arena in which robots collide and half of them die."""

SHORT_ARENA = """
[islands.arena]
birth_interval_s = 5.0
cull_interval_s = 10.0
population_limit = 8
population_floor = 4
record_touches = true
"""

SHORT_EVALUATIONS = """
[simulation]
window_steps = 400
[selection]
population = 5
tournament_size = 2
"""

LEARNING = f"""
name = "pupils"
births = 9
{SHORT_EVALUATIONS}
children = 4
[robust]
draws = 1
[learning]
budget = 6
inherit = "lamarckian"
[learning.parameters]
population = 4
[[islands]]
[[islands]]
[islands.learning]
learner = "(1+1)-es"
budget = 3
inherit = "darwinian"
parameters = {{}}
[migration]
topology = "ring"
epoch = 5
"""
"""Two off-line islands that learn in different ways, under a disturbance."""

MIXED = f"""
name = "mixed"
births = 9
{SHORT_EVALUATIONS}
[[islands]]
births = 35
[[islands]]
{SHORT_ARENA}
[islands.learning]
learner = "(1+1)-es"
budget = 3
[migration]
topology = "ring"
epoch = 6
"""
"""An off-line island and an arena whose newborns learn, with migration."""

RING = """
name = "ring"
births = 45
[simulation]
window_steps = 80
[[islands]]
count = 8
[migration]
topology = "ring"
epoch = 15
judge_anew = true
"""

ARENAS = f"""
name = "arenas"
births = 10
{SHORT_EVALUATIONS}
[[islands]]
count = 2
{SHORT_ARENA}
[migration]
topology = "ring"
epoch = 7
epoch_s = 10.0
handling = "evict"
"""
