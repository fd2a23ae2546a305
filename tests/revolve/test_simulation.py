"""Simulations that are stepped, against evaluations in another process."""

from collections.abc import Callable

import numpy as np
import pytest

import revolve as rv

pytestmark = pytest.mark.system

SHORT = {"window_steps": 400, "warmup_steps": 30}
PLAIN = rv.Experiment.read("scenario1", simulation=SHORT)
NOISY = {**SHORT, "sensor_noise": 0.1, "actuator_noise": 0.05}
PUSHED = rv.Experiment.read(
    "scenario1",
    simulation=NOISY,
    environment={"push_impulse": 0.02, "push_interval_s": 0.5},
    calibration=[{"part": "ActiveHinge", "motor": {"gain": 0.9, "delay_s": 0.125}}],
    measures={"names": ["energy"]},
)
ROBUST = PUSHED.replace(robust={"draws": 3, "take": "least"})
SLOPES = {"setting": "environment.slope_deg", "at": [0, 99], "values": [0.0, 12.0]}
CHANGED = PLAIN.replace(changes=[{**SLOPES, "between": "linear"}]).at(70)
ROBOT = rv.Robot.random(PLAIN, seed=2, number=5)


def own_fitness(robot: rv.Robot, experiment: rv.Experiment, trial: int) -> object:
    with rv.Simulation(robot, experiment, trial=trial) as simulation:
        while not simulation.done:
            simulation.step()
        return simulation.fitness


@pytest.mark.parametrize("experiment", [PLAIN, PUSHED, ROBUST, CHANGED])
def test_own_brain_gives_the_fitness_of_an_evaluation(
    experiment: rv.Experiment,
) -> None:
    """To the last bit, alone and with others on threads."""
    robots = [rv.Robot.random(experiment, seed=2, number=n) for n in range(4)]
    expected = [rv.evaluate(robot, experiment, trial=3).fitness for robot in robots]
    assert len({*expected}) == 4
    assert [own_fitness(robot, experiment, 3) for robot in robots] == expected
    with rv.Simulations(robots, experiment, trial=3, threads=2) as together:
        while not together.done.all():
            together.step()
        assert together.fitness == expected
        together.reset(trial=4)
        assert not together.done.any()
        together.step([np.zeros(len(each.motors)) for each in together.simulations])
        alone = rv.Simulation(robots[1], experiment, trial=4)
        alone.step(np.zeros(len(alone.motors)))
        assert np.array_equal(together.observe()[1], alone.observe())


def test_window_so_far_has_a_fitness_and_a_trace() -> None:
    simulation = rv.Simulation(ROBOT, PLAIN, record=["joint_angle"])
    fitness = simulation.fitness
    assert fitness is None
    assert len(simulation.trace.joint_angle) == 0
    seen: list[float] = []
    while not simulation.done:
        simulation.step()
        if (fitness := simulation.fitness) is not None:
            seen.append(fitness)
    whole = rv.evaluate(ROBOT, PLAIN, record=["joint_angle"])
    assert len({*seen}) > 5
    assert seen[-1] == whole.fitness
    traces = [simulation.trace, whole.trace]
    angles = [each.joint_angle for each in traces if each is not None]
    assert np.array_equal(angles[0], angles[1])


def test_start_is_that_of_the_experiment_or_another_one() -> None:
    simulation = rv.Simulation(ROBOT, PLAIN)
    simulation.reset(place=(1.0, 2.0), attitude_deg=(0.0, 5.0, 90.0))
    turned = rv.Simulation(
        ROBOT, PLAIN.replace(simulation={"start_deg": [0.0, 5.0, 90.0]})
    )
    here, there = turned.data.qpos.copy(), simulation.data.qpos
    here[:2] += 1.0, 2.0
    assert np.array_equal(here, there)
    simulation.reset()
    assert np.array_equal(simulation.data.qpos[:2], (0.0, 0.0))


def test_observations_have_names_and_pictures_the_state() -> None:
    simulation = rv.Simulation(ROBOT, PLAIN)
    seen = dict(zip(simulation.inputs, simulation.observe(), strict=True))
    assert seen["acceleration z of part 0"] == pytest.approx(9.81)
    assert simulation.motors == ("motor of part 3", "motor of part 4")
    first = simulation.render(64, 48)
    assert first.shape == (48, 64, 3)
    assert first.dtype == np.uint8
    simulation.step([1.0, 1.0])
    assert not np.array_equal(simulation.render(64, 48), first)


def test_a_failed_robot_stops_alone() -> None:
    with rv.Simulations([ROBOT, ROBOT], PLAIN) as together:
        together.step()
        together.simulations[0].data.qvel[:] = np.nan
        while not together.done.all():
            together.step()
        failures = [each.failure for each in together.simulations]
        assert "physics diverged by" in failures[0]
        assert failures[1] == ""
        assert together.fitness == [None, rv.evaluate(ROBOT, PLAIN).fitness]


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda s: s.step([1]), "action: must be 2 finite numbers, one per motor, got"),
        (lambda s: s.step([1, np.nan]), "action: must be 2 finite numbers, one per"),
        (lambda s: s.step("ab"), "action: must be 2 finite numbers, one per motor, go"),
        (lambda s: s.reset(place=3), "place: must be 2 finite numbers, x and y [m]"),
        (lambda s: s.reset(attitude_deg=(1, 2)), "attitude_deg: must be 3 finite num"),
        (
            lambda s: s.reset(trial=-1),
            "trial: must be a whole number from 0 to 1000000",
        ),
        (lambda s: s.render(0, 3), "width: must be a whole number from 1 to 4096, got"),
        (lambda _: rv.Simulations({ROBOT}, PLAIN), "robots: must be a list, or anot"),
        (
            lambda _: rv.Simulations([ROBOT], PLAIN).step([]),
            "actions: must be 1, got 0",
        ),
        (
            lambda _: rv.Simulations([ROBOT], PLAIN, threads=0),
            "threads: must be a whole number from 1 to",
        ),
    ],
)
def test_wrong_arguments_are_refused_in_one_line(
    call: Callable[[rv.Simulation], object], line: str
) -> None:
    simulation = rv.Simulation(ROBOT, PLAIN)
    with pytest.raises(rv.RevolveError) as caught:
        call(simulation)
    assert str(caught.value).startswith(line)
    assert "\n" not in str(caught.value)


def test_a_simulation_that_is_over_must_be_reset() -> None:
    simulation = rv.Simulation(ROBOT, PLAIN)
    while not simulation.done:
        simulation.step()
    with pytest.raises(rv.RevolveError, match="over; reset starts it again"):
        simulation.step()
    simulation.reset()
    simulation.step()
