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
[[changes]]
setting = "simulation.friction"
at = [0, 6]
values = [1.0, 0.2]
between = "linear"
period = 12
"""
"""Evaluations of 2 s to 4 s, a quarter of them re-evaluations; friction changes."""

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

SEASONS = f"""{SMALL_ARENA}
[[changes]]
setting = "simulation.friction"
at = [0, 6]
values = [1.0, 0.3]
period = 12
[[changes]]
setting = "environment.slope_deg"
at = [0, 8]
values = [0.0, 4.0]
between = "linear"
period = 16
"""
"""The same arena, in which friction and slope change."""

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
[space]
max_hidden = 60
[brain]
type = "modular"
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
budget = 5
inherit = "samples"
peers = 1
parameters = {{}}
[migration]
topology = "ring"
epoch = 5
"""
"""Two off-line islands that learn in different ways, under a disturbance.

On the second one, children begin with brains of their parents and of a peer.
"""

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
peers = 1
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

DIVERSE = """
name = "diverse"
births = 24
[simulation]
window_steps = 80
[selection]
population = 6
children = 6
tournament_size = 2
[measures]
names = ["body_size", "straight_velocity"]
[grid]
measures = ["body_size", "straight_velocity"]
bounds = [[3, 31], [0, 0.5]]
bins = [7, 5]
[[islands]]
[islands.selection]
parents = "curiosity"
survivors = "map-elites"
[[islands]]
[islands.selection]
parents = "novelty"
survivors = "novelty"
survivors_parameters = {nearest = 3, threshold = 0.1, capacity = 9}
[[islands]]
[islands.selection]
survivors = "dominated-novelty"
[[islands]]
[islands.selection]
parents = "nsga2"
parents_parameters.objectives = {fitness = "max", body_size = "min"}
survivors = "nsga2"
survivors_parameters.objectives = {fitness = "max", body_size = "min"}
[[islands]]
[islands.selection]
parents = "age-layered"
survivors = "age-layered"
[migration]
topology = "ring"
epoch = 6
replaced = "rule"
"""
"""An island of each rule of diversity; the rule of the receiver judges migrants."""

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

POND_RULES = """mating_s = 1.0
mating_distance_m = 0.5
rest_s = 10.0
maturity_s = 5.0
energy_per_s = 0.15
lifespan_s = 120.0
patch_motion = "regrowing"
patch_radius_m = 0.8
patch_capacity = 12.0
patch_spread_m = 0.8
start_energy = 12.0
child_energy = 6.0
"""
_POND_ARENA = """rules = "ecosystem"
birth_interval_s = 1.0
cull_interval_s = 1.0
sample_interval_s = 1.0
snapshot_interval_s = 6.0
birth_radius_m = 0.8
population_limit = 40
"""
_SMALL = """name = "pond"
births = 45
[selection]
population = 14
[simulation]
warmup_steps = 200
window_steps = 800
"""
POND = f"{_SMALL}[arena]\n{_POND_ARENA}[arena.parameters]\n{POND_RULES}"
PONDS = f"""{_SMALL}[space]
part_types = [
    "schema.parts:CORE",
    "schema.parts:FIXED_BRICK",
    "schema.parts:ACTIVE_HINGE",
    "schema.parts:LIGHT_SENSOR",
]
[[islands]]
count = 2
[islands.arena]
{_POND_ARENA}patch_light_m = 0.1
[islands.arena.parameters]
{POND_RULES}[migration]
topology = "ring"
epoch = 20
"""
"""Two ecosystems between which robots migrate; their robots see the patches."""
