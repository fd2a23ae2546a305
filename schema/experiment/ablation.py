"""Ablation of one robot: sensors and motors that do not work in an evaluation.

It is a part of requests, not of an experiment: its numbers are those of one robot.
"""

from collections.abc import Iterator

from schema.experiment.section import Count, Section


class Ablation(Section, frozen=True):
    """Inputs of a brain that are held, and motors that are dead.

    Attributes:
        inputs: (number of the input, value) of each held input. The brain receives the
            value at every tick, without noise; with None the mean of what it receives
            at the ticks of the same evaluation without the ablation.
        motors: numbers of the dead motors. A dead motor gets the neutral output 0.5 at
            every tick: the middle of its joint's range, or velocity 0. The brain runs
            on.
    """

    inputs: tuple[tuple[Count, float | None], ...] = ()
    motors: tuple[Count, ...] = ()

    @property
    def has_means(self) -> bool:
        """Whether some inputs are held at their mean."""
        return any(value is None for _, value in self.inputs)


def ablation_problems(ablation: Ablation, inputs: int, motors: int) -> Iterator[str]:
    """Yield which inputs and motors of an ablation a robot does not have.

    Args:
        ablation: of the robot.
        inputs: number of its brain's inputs.
        motors: number of its motors.
    """
    held = [number for number, _ in ablation.inputs]
    for what, numbers, count in (
        ("inputs", held, inputs),
        ("motors", ablation.motors, motors),
    ):
        for number in numbers:
            if number >= count:
                yield f"ablation.{what}: the robot has {count}, got number {number}"
