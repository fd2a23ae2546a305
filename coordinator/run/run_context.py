"""What all requests of a run have in common."""

from collections.abc import Mapping
from typing import Self

from msgspec import Struct, structs

from coordinator.dispatch.events import Client
from schema.experiment.document import Experiment, body_space, island_experiments
from schema.experiment.identity import Origin
from schema.experiment.settings import (
    arena_settings,
    breeding_plugins,
    breeding_settings,
    evaluation_settings,
)
from schema.parts import BodySpace
from schema.plugins.source import plugins_of
from schema.wire.arena import AdvanceShard
from schema.wire.codec import encode
from schema.wire.messages import Request


class RunContext(Struct, frozen=True):
    """What every request of a run carries beside the robot or the changes.

    Attributes:
        client: name of the run, and epoch of its coordinator.
        origin: seeds the noise; each request sets its own island.
        breeding: settings for analyzers, and JSON that names the plug-ins which they
            need, by island.
        evaluation, arena: settings for workers, as JSON, by island.
        experiments: settings of each island, for checks of answers.
    """

    client: Client
    origin: Origin
    breeding: Mapping[int, tuple[bytes, bytes]]
    evaluation: Mapping[int, bytes]
    arena: Mapping[int, bytes]
    experiments: Mapping[int, Experiment]
    space: BodySpace

    def arena_request(self, number: int, work: AdvanceShard) -> bytes:
        """Return the request of a job that advances an arena, or a part of one."""
        run, epoch = self.client
        settings = self.arena[work.island]
        return encode(Request(run, epoch, number, work, settings, plugins_of(settings)))

    @classmethod
    def of(cls, run: str, epoch: int, experiment: Experiment, origin: Origin) -> Self:
        """Return the context of a run of an experiment."""
        experiments = dict(enumerate(island_experiments(experiment)))
        return cls(
            Client(run, epoch),
            origin,
            {
                number: (breeding_settings(own), breeding_plugins(own))
                for number, own in experiments.items()
            },
            {number: evaluation_settings(own) for number, own in experiments.items()},
            {
                number: arena_settings(own, structs.replace(origin, island=number))
                for number, own in experiments.items()
                if own.arena
            },
            experiments,
            body_space(experiment.space),
        )
