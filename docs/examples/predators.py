"""Predators: large robots take energy from those they meet, and divide."""

import msgspec
import numpy as np

import revolve as rv


class Predators:
    """A robot without energy dies; one with enough has a child, and shares with it."""

    class Parameters(msgspec.Struct):
        """Energy: of the light, shared by all; lost; taken by a predator; to divide."""

        light_per_s: float = 6.0
        loss_per_s: float = 0.1
        bite_per_s: float = 2.0
        divides_at: float = 15.0

    def __init__(self, _experiment: rv.Experiment, parameters: Parameters) -> None:
        self.stores, self.meeting_distance_m = {"energy": 10.0}, 0.4
        self.parameters = parameters

    def decide(self, view: rv.ArenaView, _rng: np.random.Generator) -> rv.Decisions:
        """Return who dies, who divides, and the energy of all others."""
        rules, robots = self.parameters, {robot.birth: robot for robot in view.robots}
        gain = rules.light_per_s / max(1, len(robots)) - rules.loss_per_s
        energy = {
            birth: robot.stores["energy"] + gain * view.interval_s
            for birth, robot in robots.items()
        }
        for meeting in view.meetings:
            pair = meeting.first, meeting.second
            prey, predator = sorted(pair, key=lambda birth: robots[birth].parts)
            if robots[prey].parts < robots[predator].parts:
                bite = min(rules.bite_per_s * meeting.duration_s, energy[prey])
                energy[prey] -= bite
                energy[predator] += bite
        dead = [birth for birth in robots if energy[birth] <= 0.0]
        stores = {b: {"energy": energy[b]} for b in robots if energy[b] > 0.0}
        births: list[rv.Conception] = []
        for birth in stores if view.room else ():
            if energy[birth] >= rules.divides_at:
                stores[birth] = {"energy": energy[birth] / 2}
                births += [
                    rv.Conception((birth,), robots[birth].place, 0.5, stores[birth])
                ]
        deaths = tuple(rv.Death(birth, "no energy") for birth in dead)
        return rv.Decisions(tuple(births), deaths, stores)
