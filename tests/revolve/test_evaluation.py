"""Robots, genomes and their evaluation, against the command's results."""

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from msgspec import structs

import revolve as rv
from revolve.children import SIMULATOR
from revolve.experiment import document_of
from revolve.robot import plain
from schema.experiment.identity import NO_ORIGIN, Identity
from schema.experiment.settings import evaluation_settings_of
from schema.robot.ids import NOBODY
from tests.own_brains import write_module
from tests.system.workspace import Workspace
from worker.robot.evaluation import evaluate as evaluate_here

pytestmark = pytest.mark.system

_WIDE = """
name = "wide"
[space]
max_hidden = 800
[simulation]
window_steps = 400
"""


def _wide_robot(experiment: rv.Experiment) -> rv.Robot:
    """Return a robot whose network is so wide that BLAS would use several threads."""
    robot = rv.Robot.random(experiment, seed=2)
    rng = np.random.default_rng(3)
    old = robot.brain.neurons
    kept = tuple(n for n in old if n.layer != "hidden")
    outputs = [i for i, n in enumerate(old) if n.layer == "output"]
    part = old[outputs[0]].part
    added = tuple(rv.Neuron("hidden", "Simple", part, (0.0, 0.9)) for _ in range(780))
    hidden = range(len(kept), len(kept) + len(added))
    ends = [(source, target) for target in hidden for source in outputs]
    ends += [(source, target) for source in hidden for target in outputs]
    edges = tuple(rv.Connection(*each, float(rng.normal())) for each in ends)
    return rv.Robot(robot.parts, rv.Brain((*kept, *added), edges), experiment)


def _by_command(
    robot: rv.Robot, experiment: rv.Experiment, folder: Path, *flags: str
) -> float:
    """Return the fitness that the command prints with all digits."""
    robot.write(folder / "robot.yaml")
    (folder / "mine.toml").write_text(experiment.to_toml())
    words = ("robot", "simulate", "robot.yaml", "--experiment", "mine.toml", *flags)
    found = re.search(r"^fitness: +(\S+)$", Workspace(folder).run(*words), re.MULTILINE)
    assert found
    return float(found[1])


def test_evaluation_equals_the_command_to_the_last_bit(tmp_path: Path) -> None:
    # NumPy is loaded here already, with as many threads as it likes.
    experiment = rv.Experiment.read("scenario1", simulation={"window_steps": 800})
    robot = rv.Robot.random(experiment, seed=5)
    result = rv.evaluate(robot)
    assert result.fitness == _by_command(robot, experiment, tmp_path)
    assert result.fitness
    assert result.failure == ""


def test_a_wide_network_gives_the_same_bits_as_the_command(tmp_path: Path) -> None:
    experiment = rv.Experiment.from_toml(_WIDE)
    robot = _wide_robot(experiment)
    assert rv.evaluate(robot).fitness == _by_command(robot, experiment, tmp_path)


def test_trace_gives_the_velocities_of_the_result() -> None:
    robot = rv.Robot.random(seed=5)
    result = rv.evaluate(robot, "scenario1")
    trace = result.trace
    assert trace is not None
    ends = trace.core_position[[0, -1], :2]
    duration_s = (len(trace.core_position) - 1) * trace.interval_s
    assert duration_s == pytest.approx(12.0)
    straight = math.dist(*ends) / duration_s
    assert result.straight_velocity == pytest.approx(straight, rel=1e-12)
    again = rv.simulate(robot, "scenario1")
    assert np.array_equal(again.core_position, trace.core_position)


NOISY = rv.Experiment.from_toml(
    'name = "noisy"\n[simulation]\nwindow_steps = 400\nactuator_noise = 0.2\n'
)


def test_trials_draw_noise_anew_and_the_first_is_that_of_the_command(
    tmp_path: Path,
) -> None:
    robot = rv.Robot.random(NOISY, seed=5)
    trials = [rv.evaluate(robot, trial=trial) for trial in range(3)]
    settings = evaluation_settings_of(document_of(NOISY))
    for trial, result in enumerate(trials):
        identity = Identity(NO_ORIGIN, NOBODY, trial)
        assert result.fitness == evaluate_here(plain(robot), settings, identity).fitness
    assert rv.evaluate(robot) == trials[0]
    assert len({result.fitness for result in trials}) == 3
    assert trials[0].fitness == _by_command(robot, NOISY, tmp_path)
    assert trials[2].fitness == _by_command(robot, NOISY, tmp_path, "--trial", "2")
    trace = rv.simulate(robot, trial=2)
    assert np.array_equal(trace.core_position, trials[2].trace.core_position)  # type: ignore[union-attr]


def test_channels_are_recorded_on_demand_and_change_nothing() -> None:
    robot = rv.Robot.random(NOISY, seed=5)
    names = ["joint_angle", "outputs", "commands", "part_poses"]
    trace, plain_trace = rv.simulate(robot, record=names), rv.simulate(robot)
    assert np.array_equal(trace.core_position, plain_trace.core_position)
    samples, motors = len(trace.core_position), robot.brain.count("output")
    assert trace.outputs.shape == trace.commands.shape == (samples, motors)
    assert trace.part_poses.shape == (samples, len(robot.parts), 7)
    assert np.array_equal(trace.part_poses[:, 0, :3], trace.core_position)
    with pytest.raises(rv.ExperimentError, match=r"trace\.outputs is not recorded"):
        _ = plain_trace.outputs
    judged = rv.evaluate(robot, record=names)
    assert judged == rv.evaluate(robot)
    assert judged.trace is not None
    assert np.array_equal(judged.trace.part_poses, trace.part_poses)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ({"record": "outputs"}, "record: must be a list of names, got 'outputs'"),
        ({"record": 5}, "record: must be a list of names, got 5"),
        ({"record": {"outputs"}}, "record: must be a list of names, got {'outputs'}"),
        (
            {"record": ["output"]},
            "record: 'output' is not a channel; did you mean 'out",
        ),
        ({"record": ["energy", 3]}, "record: 3 is not a channel; channels: core_att"),
        ({"trial": -1}, "trial: must be a whole number from 0 to 1000000, got -1"),
        ({"trial": 2.0}, "trial: must be a whole number from 0 to 1000000, got 2.0"),
        ({"trial": True}, "trial: must be a whole number from 0 to 1000000, got True"),
        (
            {"trial": 10**7},
            "trial: must be a whole number from 0 to 1000000, got 1000",
        ),
        ({"trial": "1"}, "trial: must be a whole number from 0 to 1000000, got '1'"),
    ],
)
def test_mistakes_of_trials_and_channels(words: dict[str, Any], line: str) -> None:
    robot = rv.Robot.random(NOISY, seed=5)
    for function in (rv.evaluate, rv.simulate):
        with pytest.raises(rv.RevolveError) as caught:
            function(robot, **words)
        assert str(caught.value).startswith(line)
        assert "\n" not in str(caught.value)


def test_robot_without_experiment_may_have_any_built_in_neuron(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(
        "body: {type: Core, children: {1: {slot: 0, id: leg, type: ActiveHinge}}}\n"
        "brain: {neurons: [{part: leg, layer: output, type: PhaseOscillator}]}"
    )
    robot = rv.Robot.read(file)
    robot.write(tmp_path / "robot.pb")
    assert rv.Robot.read(tmp_path / "robot.pb") == robot
    with pytest.raises(rv.InvalidRobot, match="must be one of Simple, "):
        rv.evaluate(robot)
    cpg = rv.Experiment.read(
        "scenario1", brain={"type": "cpg"}, simulation={"window_steps": 400}
    )
    assert rv.evaluate(robot, cpg).fitness is not None


def test_invalid_robot_raises_before_anything_runs(tmp_path: Path) -> None:
    robot = rv.Robot.random(seed=1)
    broken = rv.Robot(robot.parts[:1] + robot.parts, robot.brain)
    with pytest.raises(rv.InvalidRobot, match="body"):
        rv.evaluate(broken)
    with pytest.raises(rv.InvalidRobot, match="must end in one of"):
        rv.Robot.read("robot.doc")
    (tmp_path / "robot.pb").write_bytes(b"\x00\xff")
    with pytest.raises(rv.InvalidRobot, match=r"robot\.pb: not the bytes of a Robot"):
        rv.Robot.read(tmp_path / "robot.pb")
    path: Any = "robot.yaml"
    with pytest.raises(rv.InvalidRobot, match=r"got 'robot\.yaml': Robot\.read reads"):
        rv.evaluate(path)


def test_values_of_another_type_are_refused(tmp_path: Path) -> None:
    robot = rv.Robot.random(seed=1, number=7)
    brain, wrong = robot.brain, cast("Any", "a")
    edge = structs.replace(brain.connections[0], weight=wrong)
    neuron = structs.replace(brain.neurons[0], part=1.5)
    part = structs.replace(robot.parts[0], parameters=(wrong,) * 3)
    for changed in (
        replace(robot, brain=rv.Brain(brain.neurons, (edge,))),
        replace(robot, brain=rv.Brain((neuron, *brain.neurons[1:]), brain.connections)),
        replace(robot, parts=(part, *robot.parts[1:])),
        replace(robot, parts=cast("Any", None)),
        replace(robot, brain=cast("Any", object())),
    ):
        with pytest.raises(rv.InvalidRobot, match="robot: must be "):
            rv.evaluate(changed)
        with pytest.raises(rv.InvalidRobot, match="robot: must be "):
            changed.write(tmp_path / "a.yaml")


def test_numbers_of_numpy_are_those_of_python() -> None:
    robot = rv.Robot.random(seed=1, number=7)
    brain = robot.brain
    neurons = [
        structs.replace(each, parameters=np.array(each.parameters))
        for each in brain.neurons
    ]
    edges = [
        structs.replace(
            each, weight=np.float64(each.weight), source=np.int64(each.source)
        )
        for each in brain.connections
    ]
    changed = rv.Brain(tuple(neurons), tuple(edges))
    assert rv.evaluate(replace(robot, brain=changed)) == rv.evaluate(robot)


def test_failing_fitness_and_crash_are_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "odd_fitness.py").write_text(
        "import os, signal\n"
        "def undefined(track, fitness):\n"
        "    # Not on the short and long tracks of the check.\n"
        "    return float('nan') if len(track.core_position) == 11 else 1.0\n"
        "def crash(track, fitness):\n    os.kill(os.getpid(), signal.SIGSEGV)\n"
    )
    monkeypatch.chdir(tmp_path)
    text = 'name = "odd"\n[simulation]\nwindow_steps = 400\n[fitness]\nfunction = '
    robot = rv.Robot.random(seed=1)
    for name, expected in (("undefined", "finite number"), ("crash", "SIGSEGV")):
        (tmp_path / "odd.toml").write_text(f'{text}"odd_fitness:{name}"\n')
        result = rv.evaluate(robot, "odd.toml")
        assert result.fitness is None
        assert expected in result.failure
    # The next evaluation has a new process.
    assert rv.evaluate(robot, "scenario1").failure == ""
    missing = rv.Experiment.from_toml(f'{text}"odd_fitness:undefned"\n')
    with pytest.raises(rv.UnknownPlugin, match="did you mean"):
        rv.evaluate(robot, missing)


def test_interrupt_in_a_plugin_is_raised_once_and_ends_the_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "interrupted.py").write_text(
        "def fitness(track, fitness):\n    raise KeyboardInterrupt\n"
    )
    monkeypatch.chdir(tmp_path)
    experiment = rv.Experiment.from_toml(
        'name = "odd"\n[fitness]\nfunction = "interrupted:fitness"\n'
    )
    robot = rv.Robot.random(seed=1)
    with pytest.raises(KeyboardInterrupt) as caught:
        rv.evaluate(robot, experiment)
    assert caught.value.__suppress_context__
    assert SIMULATOR._child is None
    assert capfd.readouterr().err == ""
    assert rv.evaluate(robot, "scenario1").failure == ""


def test_genomes_mate_repeatably_and_develop_into_valid_robots() -> None:
    def child(seed: int) -> rv.Genome | None:
        rng = np.random.default_rng(seed)
        first, second = (rv.Genome.random(rng, "scenario1") for _ in range(2))
        return first.mate(second, rng)

    children = [child(seed) for seed in range(8)]
    assert children == [child(seed) for seed in range(8)]
    grown = [each for each in children if each is not None]
    assert len(grown) > 4
    for each in grown:
        settings = evaluation_settings_of(document_of(each.experiment))
        evaluate_here(plain(each.develop()), settings)
        assert rv.Genome.from_bytes(each.to_bytes(), "scenario1") == each


@pytest.mark.parametrize(
    "kind",
    [
        '[brain]\ntype = "my_brains:Wave"',
        '[space]\nneuron_types = ["my_brains:Adapting"]',
    ],
)
def test_own_brains_are_evaluated_and_written(tmp_path: Path, kind: str) -> None:
    write_module(tmp_path)
    file = tmp_path / "own.toml"
    file.write_text(f'name = "own"\n{kind}\n[simulation]\nwindow_steps = 80\n')
    robot = rv.Robot.random(file, seed=1, number=7)
    own = {neuron.kind for neuron in robot.brain.neurons} - {"Input"}
    assert len(own) == 1
    assert own <= {"Waver", "Adapting"}
    result = rv.evaluate(robot, file)
    assert result.failure == ""
    assert result.fitness == _by_command(robot, rv.Experiment.read(file), tmp_path)
    for name in ("a.yaml", "a.pb", "a.xml", "a.urdf"):
        robot.write(tmp_path / name)
        if name != "a.urdf":
            assert rv.Robot.read(tmp_path / name, file) == robot
    with pytest.raises(rv.InvalidRobot, match=r"must be one of Simple, .* got '"):
        rv.evaluate(robot, "scenario1")


def test_genome_needs_a_generator() -> None:
    wrong: Any = 3
    with pytest.raises(rv.RevolveError, match=r"rng: must be a numpy.* got 3; numpy"):
        rv.Genome.random(wrong)
    genome = rv.Genome.random(np.random.default_rng(1))
    with pytest.raises(rv.RevolveError, match="rng: must be"):
        genome.mate(genome, wrong)


def test_genomes_of_other_encodings() -> None:
    patterns = rv.Experiment.read("scenario1", encoding={"type": "cppn"})
    rng = np.random.default_rng(1)
    first, second = (rv.Genome.random(rng, patterns) for _ in range(2))
    children = [first.mate(second, rng) for _ in range(5)]
    child = next(filter(None, children))
    assert rv.Genome.from_bytes(child.to_bytes(), patterns) == child
    assert child.develop().experiment == patterns
    genome = rv.Genome.random(rng, "scenario1")
    with pytest.raises(rv.InvalidRobot, match="not a genome of encoding 'revolve-ang"):
        rv.Genome.from_bytes(child.to_bytes(), "scenario1")
    again = (rv.Robot.random(patterns, seed=4) for _ in range(2))
    assert next(again) == next(again) != rv.Robot.random("scenario1", seed=4)
    for one, other in ((child, genome), (genome, child)):
        with pytest.raises(rv.RevolveError, match="different encodings cannot mate: '"):
            one.mate(other, rng)
    wrong: Any = child.develop()
    with pytest.raises(rv.RevolveError, match="other: must be a Genome, got <Robot"):
        child.mate(wrong, rng)


def test_seeds_and_sizes_are_checked_and_a_picture_is_a_png() -> None:
    robot = rv.Robot.random(seed=1)
    for name, ask in (
        ("seed", lambda: rv.Robot.random(seed=2**64)),
        ("number", lambda: rv.Robot.random(number=2**32)),
        ("width", lambda: robot.picture(0, 16)),
        ("height", lambda: robot.picture(16, 4097)),
    ):
        with pytest.raises(rv.RevolveError, match=f"^{name}: must be a whole number"):
            ask()
    try:
        picture = robot.picture(64, 48)
    except rv.RevolveError as error:
        pytest.skip(str(error))
    assert picture.startswith(b"\x89PNG")
    assert robot._repr_png_() is not None
