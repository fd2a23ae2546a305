"""Wrong and inconsistent sections of an experiment: one line that names the key."""

import pytest

from tests.documents import check_refused

# Types and ranges, checked by the decoder.
VALUES = [
    ("birth = 3", r"test.toml: birth: no such key; did you mean 'births'\?"),
    ("[variation]\np_swap = 0.1", r"variation.p_swap: .* 'p_swap_subtree'\?"),
    ("[space]\nmax_part = 9", r"space.max_part: .* 'max_parts'\?; allowed: part_"),
    ("[selektion]\nwindow = 1", "did you mean 'selection'"),
    ("zzzz = 1", "zzzz: no such key; allowed: name, births"),
    ("seed = 4", "test.toml: seed: is a flag of revolve run, --seed, not a key"),
    ('births = "many"', r"births: must be a whole number, got 'many'"),
    ("births = 0", r"births: .*>= 1.*, got 0"),
    ("births = 2.5", "births: "),
    ("[variation]\nbody_epsilon = 1.5", r"variation.body_epsilon: .*, got 1.5"),
    ("[generation]\nparts_mean = nan", "generation.parts_mean: "),
    ("[simulation]\ntimestep_s = inf", "simulation.timestep_s: "),
    ("[simulation]\nsensor_noise = -0.1", "simulation.sensor_noise: .*, got -0.1"),
    ("[simulation]\nactuator_noise = 2e6", r"actuator_noise: .*<= 1.*, got 2000000"),
    ("[simulation]\nevaluation_s = 30", "must be a list of length 2, got 30"),
    ("[robust]\nfriction = 1", "must be a list of length 2, got 1"),
    ("[space]\npart_types = 3", "must be a list, got 3"),
    ("[simulation]\nevaluation_s = [30]", r"length 2, got \[30\]"),
    ("[simulation]\nevaluation_s = [12, inf]", "must be finite"),
    ("[selection.reevaluation]\nfitness = 'meen'", "fitness: .*did you mean 'mean'"),
    ("[selection.reevaluation]\nshare = 0", "share: must be a number > 0"),
    ("[vetting]\nmode = 3", "must be one of 'overlap', 'contact', got 3"),
    ("space = 3", "space: must be a table"),
    ("[space]\npart_types = [1]", r"space.part_types\[0\]: .*, got 1"),
    ("[[", "test.toml: not valid TOML: "),
    ("arena = 3", "arena: must be a table"),
    ("[arena]\nlight = [nan, 0, 1]", r"light\[0\]: must be finite, got nan"),
    ("[arena]\npopulation_limit = 0", "arena.population_limit: .*, got 0"),
    ("[robust]\ndraws = 0", "robust.draws: must be .* >= 1, got 0"),
    ("[robust]\nmass = [0, 1]", r"robust.mass\[0\]: must be a number > 0.0, got 0"),
    ("[learning]\nbudget = 1001", "learning.budget: must be .* <= 1000, got 1001"),
    ("[learning]\nsigma = 0", "learning.sigma: must be .* > 0.0, got 0"),
    ("[environment]\nslope_deg = 45.0", "slope_deg: must be .* < 45.0, got 45.0"),
    ("[environment]\nscenery = 3", "environment.scenery: must be a text, got 3"),
]
OFF_LINE = [
    ("[arena]\n[simulation]\nevaluation_s = [12, 20]", "simulation.evaluation_s"),
    ("[arena]\n[simulation]\nstart_deg = [0, 1, 0]", "simulation.start_deg"),
    ("[arena]\n[environment]\npush_impulse = 0.1", "environment.push_impulse"),
    ("[arena]\n[selection.culling]", "selection.culling"),
    ("[arena]\n[selection.reevaluation]", "selection.reevaluation"),
    ("[robust]\n[[islands]]\n[[islands]]\narena = {}", r"islands\[1\]: robust"),
    ("[arena]\n[[calibration]]\npart = 'Core'", "calibration"),
]
# Checks across keys.
SELECTION = [
    ("births = 14", "births: must be >= selection.population = 15, got 14"),
    ("[selection]\npopulation = 4", "be >= 5, .* with tournament_size = 4, got 4"),
    ("[selection]\npopulation = 1\nparents = 'random'", "must be >= 2, .*nts, got 1"),
    ("[selection]\nchildren = 9\nkeep_parents = false", "children: must be >= .* = 15"),
    ("[selection]\nwindow = 16", "children: must be >= .*window = 16, got 15"),
    ("[selection]\nparents = 'rank'", "parents: must be one of .* none, .* got 'rank'"),
    ("[[islands]]\nselection = {survivors = 'bets'}", r"islands.0.: .*mean 'best'"),
    ("[selection.culling]\npopulation_floor = 4", "population_floor: must be >= 5"),
    ("[selection.culling]\npopulation_limit = 14", "population_limit: .* 15, .* 14"),
    (
        "[selection.culling]\npopulation_limit = 20\npopulation_floor = 20",
        "population_limit: must be >= 21, for population_floor .* got 20",
    ),
    ("[selection.culling]\nfull_cull_share = 0.01", "full_cull_share: must remove"),
    ("[selection]\nsurvivors = 'random'\nculling = {}", "culling: survival depends on"),
    ("[selection]\nkeep_parents = false\nculling = {}", "culling: survival depends on"),
    ("[selection]\nkeep_parents = false\nreevaluation = {}", "no individual outlives"),
]
CLOCKS = [
    ("[simulation]\npose_steps = 41", "must be a whole multiple of 41, .* got 2400"),
    ("[simulation]\nevaluation_s = [11.9, 30]", "must be >= 12 s, .* got 11.9"),
    ("[simulation]\nwarmup_steps = 600\nevaluation_s = [14, 20]", "must be >= 15 s"),
    ("[simulation]\nevaluation_s = [30, 20]", r"\[least, greatest\], got \[30"),
    ("[arena]\nbirth_interval_s = 15.1", "birth_interval_s: .* 1, .* got 15.1"),
    ("[arena]\nsample_interval_s = 0.001", "sample_interval_s: must be a whole"),
    ("[arena]\nsample_interval_s = 1e-13", "sample_interval_s: must be a whole"),
    ("[arena]\nfounder_interval_s = 0.5", "founder_interval_s: .* 1, the common"),
    ("[arena]\n[simulation]\nwarmup_steps = 601", "warmup_steps: .* 40, .*got 601"),
    (
        "[arena]\n[learning]\n[simulation]\nwindow_steps = 2440",
        "window_steps: must be a whole multiple of 25, simulation.brain_steps",
    ),
    (
        "simulation.warmup_steps = 240\n[learning]\n[[islands]]\n[islands.arena]",
        r"islands\[0\]: simulation.warmup_steps: .* got 240",
    ),
]
OTHERS = [
    ("[space]\nmin_parts = 31", "space.max_parts: must be >= .* = 31, got 30"),
    ("[space]\nmin_parts = 1\nmax_parts = 1", "space.max_parts: must be > 1"),
    ("[space]\nmax_inputs = 5", "space.max_inputs: must be >= 6"),
    ("[arena]\npopulation_floor = 31", r"limit: must be >= 31, for .* got 30"),
    ("[arena]\npopulation_limit = 14", r"limit: must be >= 15, for .* got 14"),
    ("[arena]\npopulation_floor = 4", "floor: must be >= 5, .*, got 4"),
    ("[arena]\n[selection]\nsurvivors = 'random'", "arena: survival depends on"),
    ("[arena]\nsplit_distance_m = 0.01", "split_distance_m: must be >= "),
    ("[arena]\nwall_diameter_m = 3", "birth_radius_m: must be less .*, 1.5 m, .*got 2"),
    ("[robust]\nfriction = [1.1, 0.9]", r"friction: must be \[least, .*\[1.1, 0.9\]"),
    ("[learning]\nlearner = 'cma'", "learner: must be .*random.*mean 'cma-es'"),
    ("[learning]\nweight_limits = [1, 1]", "limits: must be two numbers, got 1 twice"),
    ("[learning]\n[selection.reevaluation]", "learning: cannot be combined with selec"),
    (
        "[encoding]\ntype = 'cppn'\n[learning]\ninherit = 'lamarckian'",
        "learning.inherit: must be 'darwinian' with encoding.type = 'cppn'",
    ),
    (
        "[encoding]\ntype = 'cppn'\n[learning]\ninherit = 'samples'",
        "learning.inherit: samples need parts of known origin, and .*'cppn' has none",
    ),
    (
        "[encoding]\ntype = 'cppn'\n[learning]\npeers = 1",
        "learning.peers: samples need",
    ),
    (
        "[learning]\nbudget = 4\ninherit = 'samples'\npeers = 2",
        "learning.budget: must be > 4, the samples of parents and peers, got 4",
    ),
    ("brain.type = 'modular'", "max_hidden: must be >= 60 .*max_parts = 30 .* got 10"),
    (
        "brain.type = 'modular'\nspace.max_hidden = 60\n[encoding]\ntype = 'cppn'",
        "encoding.type: must be 'revolve-angle' with brain.type = 'modular', got 'cppn",
    ),
    ("[environment]\nroughness_m = 0.1\npatch_m = 0.3", "extent_m: .* multiple of 0.3"),
    ("[environment]\nroughness_m = 0.1\npatch_m = 9", "extent_m: .* multiple of 9"),
    ("[environment]\nroughness_m = 0.1\npatch_m = 0.01", "patch_m: must be >= 2 env"),
    ("[environment]\nscenery = 'none.xml'", "scenery: none.xml: cannot be read: "),
    ("[measures]\nnames = ['limp', 'my_lab:limp']", "two measures are named 'limp'"),
    (
        "[measures]\nnames = ['height']\nparameters = {heigth = {}}",
        r"measures.parameters.'heigth': not in .* did you mean 'height'\?",
    ),
]


@pytest.mark.parametrize(
    ("text", "message"), [*VALUES, *SELECTION, *CLOCKS, *OTHERS], ids=str
)
def test_wrong_sections_are_refused(text: str, message: str) -> None:
    check_refused(text, message)


@pytest.mark.parametrize(("text", "key"), OFF_LINE)
def test_keys_of_off_line_islands_are_refused_in_arenas(text: str, key: str) -> None:
    check_refused(text, f"{key}: is for off-line islands, as .*; remove it")
