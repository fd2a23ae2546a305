"""Environments of Gymnasium, by its own checker and against simulations."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import revolve as rv
from tests.system.workspace import Workspace

pytestmark = pytest.mark.system

WALKER = rv.Robot.random(seed=1, number=7)
TASKS = sorted(rv.gym.TASKS)


def env_of(task: str | rv.Experiment) -> rv.gym.RobotEnv:
    env = rv.gym.make(WALKER, task).unwrapped
    assert isinstance(env, rv.gym.RobotEnv)
    return env


def episode(env: rv.gym.RobotEnv) -> tuple[list[float], dict[str, Any]]:
    """Return rewards and last information of an episode of random actions."""
    rng = np.random.default_rng(1)
    rewards: list[float] = []
    is_over, info = False, dict[str, Any]()
    while not is_over:
        action = rng.uniform(-1.0, 1.0, len(env.simulation.motors))
        _, reward, has_failed, is_done, info = env.step(action.astype(np.float32))
        rewards.append(reward)
        is_over = has_failed or is_done
    return rewards, info


@pytest.mark.parametrize("task", TASKS)
def test_each_task_passes_the_checker_and_its_rewards_sum_to_the_fitness(
    task: str,
) -> None:
    """Warnings are errors; pictures are checked for one task, as they take long."""
    env = env_of(task)
    check_env(env, skip_render_check=task != "stairs")
    env.reset(seed=4)
    rewards, info = episode(env)
    assert sum(rewards) == pytest.approx(info["fitness"], rel=1e-9)
    assert len({*rewards}) > 20


@pytest.mark.parametrize("task", ["locomotion", "balance"])
def test_an_episode_is_a_simulation_with_actions(task: str) -> None:
    env = env_of(task)
    env.reset(options={"trial": 7})
    simulation = rv.Simulation(WALKER, rv.gym.TASKS[task], trial=7)
    rng, info = np.random.default_rng(2), dict[str, Any]()
    while not simulation.done:
        action = rng.uniform(-1.0, 1.0, len(simulation.motors)).astype(np.float32)
        simulation.step(action)
        observed, _, _, is_over, info = env.step(action)
        assert np.array_equal(observed, simulation.observe())
    assert (is_over, info) == (True, {"fitness": simulation.fitness})


def test_vectors_of_environments_are_those_environments() -> None:
    """Also those with drawn disturbances, of which each episode has one."""
    shaken = rv.Experiment.read(
        "turning", simulation={"window_steps": 400}, robust={"draws": 3}
    )
    seeds, name = [5, 6], "revolve/experiment-v0"
    env = env_of(shaken)
    together = gymnasium.make_vec(name, num_envs=2, robot=WALKER, task=shaken)
    first, _ = together.reset(seed=seeds)  # type: ignore[arg-type]
    action = np.linspace(-1.0, 1.0, len(env.simulation.motors), dtype=np.float32)
    second, rewards, *_ = together.step(np.stack([action, action]))
    assert not np.array_equal(second[0], second[1])
    for number, seed in enumerate(seeds):
        assert np.array_equal(env.reset(seed=seed)[0], first[number])
        observed, reward, *_ = env.step(action)
        assert np.array_equal(observed, second[number])
        assert reward == rewards[number]


def test_diverged_physics_ends_an_episode_without_reward() -> None:
    env = env_of("locomotion")
    env.reset(seed=1)
    still = np.zeros(len(env.simulation.motors), np.float32)
    rewards = [float(env.step(still)[1]) for _ in range(9)]
    env.simulation.data.qvel[:] = np.nan
    observed, reward, has_failed, is_over, info = env.step(still)
    assert (has_failed, is_over, info["fitness"]) == (True, False, 0.0)
    assert "physics diverged" in info["failure"]
    assert sum([*rewards, float(reward)]) == pytest.approx(0.0, abs=1e-12)
    assert np.isfinite(observed).all()


def test_robots_keep_the_part_types_of_their_experiment() -> None:
    wide = rv.Experiment.read("light", space={"max_inputs": 40, "max_outputs": 20})
    moth = rv.Robot.random(wide, seed=3, number=2)
    assert rv.gym.make(moth, "light").observation_space.shape == (
        moth.brain.count("input"),
    )
    with pytest.raises(rv.ExperimentError, match="no light in this world"):
        rv.gym.make(moth, "turning")


def test_what_cannot_be_trained_is_refused() -> None:
    with pytest.raises(rv.ExperimentError, match=r"turnin: .* did you mean 'turn"):
        rv.gym.make(WALKER, "turnin")
    inputs = tuple(each for each in WALKER.brain.neurons if each.part == 0)
    stone = rv.Robot(WALKER.parts[:1], rv.Brain(inputs))
    with pytest.raises(rv.RevolveError, match="robot: must have a motor to be trained"):
        rv.gym.make(stone, "turning")


def test_without_gymnasium_one_line_says_what_to_install(tmp_path: Path) -> None:
    code = "import sys; sys.modules['gymnasium'] = None; import revolve as rv\n"
    code += "try: rv.gym\nexcept rv.RevolveError as error: print(error)"
    told = Workspace(tmp_path).python("-c", code)
    assert told.startswith("rv.gym needs gymnasium: ")
    assert "[gym]" in told
