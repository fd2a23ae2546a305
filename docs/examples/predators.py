"""Predators: large robots take energy from those they meet, and divide."""

import msgspec
import numpy as np

import revolve as rv


class Predators:
    """A robot without energy dies; one with enough has a child, and shares with it."""

    class Parameters(msgspec.Struct):
        """Energy a second: light, for all together; loss; bite. To divide."""

        light: float = 6.0
        loss: float = 0.1
        bite: float = 2.0
        divides_at: float = 15.0

    def __init__(self, _experiment: rv.Experiment, parameters: Parameters) -> None:
        self.stores, self.meeting_distance_m = {"energy": 10.0}, 0.4
        self.parameters = parameters

    def decide(self, view: rv.ArenaView, _rng: np.random.Generator) -> rv.Decisions:
        """Return who dies, who divides, and the energy of all others."""
        rules, robots = self.parameters, {robot.birth: robot for robot in view.robots}
        gain = (rules.light / max(1, len(robots)) - rules.loss) * view.interval_s
        energy = {b: one.stores["energy"] + gain for b, one in robots.items()}
        for met in view.meetings:
            pair = met.first, met.second
            prey, hunter = sorted(pair, key=lambda b: robots[b].parts)
            if robots[prey].parts < robots[hunter].parts:
                bite = min(rules.bite * met.duration_s, energy[prey])
                energy |= {prey: energy[prey] - bite, hunter: energy[hunter] + bite}
        dead = [rv.Death(b, "no energy") for b in robots if energy[b] <= 0.0]
        mothers = [b for b in robots if energy[b] >= rules.divides_at][: view.room]
        energy |= {b: energy[b] / 2 for b in mothers}
        stores = {b: {"energy": energy[b]} for b in robots if energy[b] > 0.0}
        born = [rv.Conception((b,), robots[b].place, 0.5, stores[b]) for b in mothers]
        return rv.Decisions(tuple(born), tuple(dead), stores)
