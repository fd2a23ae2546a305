"""Robots as the Python API has them."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import msgspec
import numpy as np

from coordinator.evolution.newborns import founder
from revolve.arguments import picture_size, whole_number
from revolve.children import SIMULATOR
from revolve.experiment import Experiment, document_of
from revolve.messages import Task
from schema.errors import (
    InvalidRobot,
    MalformedMessage,
    RevolveError,
    counted,
    expectation,
    shown,
)
from schema.experiment.brains import types_of
from schema.experiment.document import Experiment as Document
from schema.experiment.document import island_experiment
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.experiment.settings import EvaluationSettings
from schema.formats.files import settings_of, types_for, write_bytes, write_robot
from schema.formats.packed import packed_robot
from schema.formats.run_settings import read_with_settings
from schema.formats.yaml_reader import OTHER_TYPES
from schema.limits import MOST_SEED
from schema.parts import BodySpace
from schema.plugins.permission import allowed
from schema.robot.archive import PACKED, RobotOrigin, read_archive
from schema.robot.brain import Brain, NeuronKinds
from schema.robot.robot import Part, check_number, check_robot
from schema.robot.robot import Robot as PlainRobot
from schema.wire.protobuf import encode_robot

DEFAULT = "scenario1"
"""Experiment of a robot that has no other one."""
_OTHER_TYPES = (
    " (name the experiment with its part types: Robot.read(path, experiment))"
)


@dataclass(frozen=True, slots=True)
class Robot:
    """A body and its brain.

    In a notebook it shows its picture, if this machine can render
    (``pip install 'revolve-islands[pictures]'``).

    Attributes:
        parts: of the body, in depth-first order; the first is the core.
        brain: network of neurons. It has the connections of the genome that lead to a
            neuron (resolved); the births table counts the others, too.
        experiment: whose part types and simulation apply; None: files and pictures may
            have all built-in types; ``evaluate`` and ``simulate`` take ``scenario1``,
            which has no light sensor.
        origin: birth and fitness, of a robot of ``Run.best``, ``Run.robot`` or a packed
            file; a changed copy has none.
    """

    parts: tuple[Part, ...]
    brain: Brain = field(default_factory=Brain)
    experiment: Experiment | None = field(default=None, compare=False)
    origin: RobotOrigin | None = field(default=None, init=False, compare=False)

    @classmethod
    def read(
        cls, path: str | Path, experiment: Experiment | str | Path | None = None
    ) -> "Robot":
        """Return the robot of a file.

        Args:
            path: ends in .yaml, .yml, .pb, .xml, .robot, .txt or .json; a run folder
                stands for its ``best.yaml``.
            experiment: whose part types are allowed, and whose simulation and fitness
                apply, those of island 0; None, as of the commands: the settings in an
                MJCF or packed file, else those of the run folder that holds the file,
                on the island where ``best.yaml`` is the best robot. Elsewhere all
                built-in types are allowed, and ``evaluate`` and ``simulate`` take
                ``scenario1``, which has no light sensor.

        Raises:
            InvalidRobot: the file holds no robot that is well formed.
            ExperimentError: no such experiment; a plug-in of the run is missing, or one
                in a packed file is not allowed (``revolve.allow``).
            RunFolderError: the description of the run is damaged.
        """
        named = None if experiment is None else document_of(experiment)
        file = Path(path)
        try:
            robot, settings, own = read_with_settings(
                file, named, say=lambda _line: None
            )
        except InvalidRobot as error:
            text = str(error).replace(OTHER_TYPES, _OTHER_TYPES)
            raise InvalidRobot(text) from None
        except MalformedMessage as error:
            raise InvalidRobot(str(error)) from None
        if own is None and settings != settings_of(None):
            sections = msgspec.structs.asdict(settings)
            del sections["ablation"], sections["record"]
            own = Document(name=file.stem, **sections)
        is_packed = file.suffix.lower() == PACKED and named is None
        origin = read_archive(file)[0].origin if is_packed else None
        return of_plain(robot, None if own is None else Experiment(own), origin)

    @classmethod
    def random(
        cls,
        experiment: Experiment | str | Path = DEFAULT,
        *,
        seed: int = 0,
        number: int = 0,
    ) -> Self:
        """Return a random robot as evolution starts with; no analyzer vets it.

        It equals file ``number`` of ``revolve robot random --unvetted --seed SEED``.

        Args:
            experiment: whose restrictions it meets.
            seed: random seed, below 2^64.
            number: of the robot among those of the seed, from 0, below 2^32.

        Raises:
            ExperimentError: no such experiment, or it allows (nearly) no robot.
            RevolveError: a seed or a number that is none of these.
        """
        seed = whole_number("seed", seed, most=MOST_SEED)
        number = whole_number("number", number)
        own = as_experiment(experiment)
        robot = founder(document_of(own), seed, number)
        return cls(robot.parts, robot.brain, own)

    def write(self, path: str | Path) -> None:
        """Write the robot to a file.

        Args:
            path: ends in .yaml, .yml, .pb, .xml (MJCF), .urdf, or .robot: packed with
                its experiment, plug-ins, picture and origin.

        Raises:
            InvalidRobot: another ending, a robot that is not well formed, or a file
                that cannot be written.
        """
        file, robot = Path(path), plain(self)
        if file.suffix.lower() == PACKED:
            document = island_experiment(document_of(self.experiment or DEFAULT), 0)
            picture = self.picture()
            write_bytes(file, packed_robot(robot, document, picture, self.origin))
        else:
            write_robot(robot, file, _settings(self.experiment))

    def to_mjcf(self) -> str:
        """Return the text of the .xml file that ``write`` makes; with its errors."""
        from schema.formats.mjcf import robot_to_mjcf  # noqa: PLC0415 - loads MuJoCo

        return robot_to_mjcf(plain(self), _settings(self.experiment))

    def to_bytes(self) -> bytes:
        """Return the bytes of the .pb file that ``write`` makes; with its errors."""
        return encode_robot(checked(self, types_for(_settings(self.experiment))))

    @property
    def part_types(self) -> BodySpace:
        """The types that its parts may have, by name: shapes, slots, joints."""
        return types_for(_settings(self.experiment))[0]

    def picture(self, width: int = 640, height: int = 480) -> bytes:
        """Return a picture of the robot in neutral pose, as PNG.

        Args:
            width: of the picture [pixels], 1 to 4096.
            height: of the picture [pixels], 1 to 4096.

        Raises:
            RevolveError: this machine cannot render, or another size.
            InvalidRobot: the robot is not well formed.
        """
        size = picture_size(width, height)
        task = task_of(self, _settings(self.experiment), size=size)
        outcome = SIMULATOR.do(task)
        if outcome.failure:
            raise RevolveError(f"the process that renders {outcome.failure}")
        return outcome.picture

    def _repr_png_(self) -> bytes | None:
        """Return the picture that a notebook shows; None if there can be none."""
        try:
            return self.picture(480, 360)
        except RevolveError:
            return None

    def __repr__(self) -> str:
        neurons = counted(len(self.brain.neurons), "neuron")
        edges = counted(len(self.brain.connections), "resolved connection")
        own = "" if self.experiment is None else f", settings of {self.experiment.name}"
        return f"<Robot: {counted(len(self.parts), 'part')}, {neurons}, {edges}{own}>"


def plain(robot: object) -> PlainRobot:
    """Return a robot as the rooms have it, with plain numbers instead of NumPy's.

    Raises:
        InvalidRobot: it is none, but the path of a file, for example; a value in it is
            of another type than it must be.
    """
    if not isinstance(robot, Robot | PlainRobot):
        hint = ": Robot.read reads a file" if isinstance(robot, str | Path) else ""
        raise InvalidRobot(f"robot must be a Robot, got {shown(robot)}{hint}")
    try:
        return _ROBOTS.decode(_encode(PlainRobot(robot.parts, robot.brain)))
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidRobot(f"robot: {expectation(str(error))}") from None


def _of_numpy(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"must be numbers and texts, got {shown(value)}")


_encode = msgspec.msgpack.Encoder(enc_hook=_of_numpy).encode
_ROBOTS = msgspec.msgpack.Decoder(PlainRobot)


def of_plain(
    robot: PlainRobot, experiment: Experiment | None, origin: RobotOrigin | None = None
) -> Robot:
    """Return a robot of the rooms as the Python API has it."""
    made = Robot(robot.parts, robot.brain, experiment)
    # No argument of the class: a changed copy is not that robot any more.
    object.__setattr__(made, "origin", origin)
    return made


def as_experiment(experiment: Experiment | str | Path) -> Experiment:
    """Return an experiment, read if it is given by name or path."""
    if isinstance(experiment, Experiment):
        return experiment
    return Experiment.read(experiment)


def checked(
    robot: Robot | PlainRobot, types: tuple[BodySpace, NeuronKinds]
) -> PlainRobot:
    """Return a robot as the rooms have it; ``InvalidRobot`` if it fits no types."""
    plainly = plain(robot)
    check_number(plainly)
    check_robot(plainly, *types)
    return plainly


def task_of(
    robot: Robot | PlainRobot,
    settings: EvaluationSettings,
    identity: Identity = NO_IDENTITY,
    *,
    is_judged: bool = False,
    size: tuple[int, int] | None = None,
) -> Task:
    """Return a task of the process that simulates single robots; see ``Task``.

    Raises:
        InvalidRobot: the robot is not well formed.
    """
    # A picture needs no brain: a robot without experiment may have any built-in one.
    types = types_for(settings) if size else types_of(settings)
    plainly = checked(robot, types)
    data = msgspec.json.encode(settings)
    return Task(data, plainly, allowed(), is_judged, size, identity)


def _settings(experiment: Experiment | None) -> EvaluationSettings:
    return settings_of(None if experiment is None else document_of(experiment))
