"""CMA-ES on the weights of a robot's brain, with all cores of this machine.

The library is https://github.com/CyberAgentAILab/cmaes (pip install cmaes).
"""

import numpy as np
from cmaes import CMA

import revolve as rv

experiment = rv.Experiment.read("scenario1", simulation={"window_steps": 1200})
robots = [rv.Robot.random(experiment, number=number) for number in range(40)]


def with_weights(weights: np.ndarray) -> rv.Robot:
    """Return the best robot with other weights of its connections."""
    pairs = zip(edges, weights.tolist(), strict=True)
    new = tuple(rv.Connection(old.source, old.target, w) for old, w in pairs)
    return rv.Robot(robot.parts, rv.Brain(robot.brain.neurons, new), experiment)


with rv.Fleet() as fleet:
    fitness = [result.fitness or 0.0 for result in fleet.evaluate(robots)]
    best = max(fitness)
    robot = robots[fitness.index(best)]
    edges = robot.brain.connections
    print(f"{len(edges)} weights, fitness before {best:.4f}")
    search = CMA(np.array([edge.weight for edge in edges]), sigma=0.3, seed=1)
    for generation in range(10):
        asked = [search.ask() for _ in range(search.population_size)]
        results = fleet.evaluate(with_weights(weights) for weights in asked)
        # A robot whose physics diverged has no fitness: here it counts as 0.
        fitness = [result.fitness or 0.0 for result in results]
        search.tell([(w, -f) for w, f in zip(asked, fitness, strict=True)])
        best = max(best, *fitness)
        print(f"generation {generation}: best fitness so far {best:.4f}")
