"""An encoding: snakes of hinges that swing, each with a period and a phase."""

from collections.abc import Mapping
from typing import Any

import msgspec
import numpy as np

import revolve as rv

Joint = tuple[float, float]
GREY = (0.5, 0.5, 0.5)


class Snakes:
    """Chains of active hinges; a genome has a period [s] and a phase for each."""

    class Parameters(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
        """The table ``[encoding.parameters]``."""

        most_joints: int = 6
        step: float = 0.2

    def __init__(
        self, experiment: Any, types: Mapping[str, rv.PartType], parameters: Parameters
    ) -> None:
        """Keep the limits of the island."""
        space = experiment.space
        self.sensors, self.step = types["Core"].inputs, parameters.step
        self.least = max(1, space.min_parts - 1)
        self.most = min(parameters.most_joints, space.max_parts - 1, space.max_outputs)

    def random(self, rng: np.random.Generator, birth: object) -> tuple[Joint, ...]:
        """Return a random genome."""
        count = int(rng.integers(self.least, self.most + 1))
        return tuple(self.joint(rng) for _ in range(count))

    def joint(self, rng: np.random.Generator) -> Joint:
        """Return a random period and phase."""
        return 0.5 + 4.5 * rng.random(), rng.random()

    def develop(self, genome: tuple[Joint, ...]) -> rv.Robot:
        """Return the snake."""
        parts = [rv.Part("Core", -1, -1, -1, 0, GREY)]
        neurons = [rv.Neuron("input", "Input", 0)] * self.sensors
        for index, (period, phase) in enumerate(genome):
            parts.append(rv.Part("ActiveHinge", index, 1 if index else 0, 0, 0, GREY))
            values = (period, phase, 1.0)
            neurons.append(rv.Neuron("output", "Oscillator", index + 1, values))
        return rv.Robot(tuple(parts), rv.Brain(tuple(neurons)))

    def crossover(
        self,
        first: tuple[Joint, ...],
        second: tuple[Joint, ...],
        rng: np.random.Generator,
    ) -> tuple[Joint, ...] | None:
        """Return the head of one and the tail of the other parent."""
        cut = int(rng.integers(0, len(first) + 1))
        child = first[:cut] + second[cut:]
        return child if len(child) >= self.least else None

    def mutate(
        self, genome: tuple[Joint, ...], rng: np.random.Generator, birth: object
    ) -> tuple[Joint, ...]:
        """Move all numbers a part of the way to random ones; the snake may grow."""
        child = []
        for joint in genome:
            pairs = zip(joint, self.joint(rng), strict=True)
            period, phase = (old + self.step * (new - old) for old, new in pairs)
            child.append((period, phase))
        if rng.random() < 0.2 and len(child) < self.most:
            child.append(self.joint(rng))
        return tuple(child)

    def to_bytes(self, genome: tuple[Joint, ...]) -> bytes:
        """Return a genome as JSON."""
        return msgspec.json.encode(genome)

    def from_bytes(self, data: bytes) -> tuple[Joint, ...]:
        """Return the genome of JSON."""
        return msgspec.json.decode(data, type=tuple[Joint, ...])
