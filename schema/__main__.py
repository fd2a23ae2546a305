"""``revolve robot``: robot files on the command line."""

from pathlib import Path

from schema.agent.flags import Flags, add_plugins, add_settings
from schema.errors import counted
from schema.experiment.document import Vetting
from schema.formats.files import types_for, write_robot
from schema.formats.run_settings import read_with_settings
from schema.limits import printable
from schema.parts import BodySpace
from schema.plugins.permission import allow
from schema.robot.archive import PACKED, read_archive
from schema.robot.brain import NeuronKinds, neuron_names
from schema.robot.robot import Robot


def main(arguments: list[str]) -> int:
    """Run ``revolve robot ...`` and return its exit code."""
    options = parser().parse_args(arguments[1:])
    allow(options.plugins)
    if options.command == "show" and options.file.suffix.lower() == PACKED:
        _show_contents(options.file)  # also if its plug-ins are not allowed
    robot, settings, experiment = read_with_settings(
        options.file, options.experiment, options.island
    )
    if options.command == "check":
        from analyzer.report import analyze

        vetting = experiment.vetting if experiment else Vetting()
        space, _ = types_for(settings)
        why = analyze(robot, space, vetting).reason
        verdict = f"not viable: {why}" if why else "viable"
        print(f"{options.file}: well formed; {_summary(robot, space)}; {verdict}")
    elif options.command == "convert":
        write_robot(robot, options.output, settings)
        print(f"{options.output}: written")
    else:
        _show(robot, *types_for(settings), options.file.name)
    return 0


def parser(_command: str = "robot") -> Flags:
    """Return the parser of ``revolve robot``."""
    flags = Flags(
        prog="revolve robot",
        description="Check, convert or show a robot file. It reads .yaml, .yml, "
        ".pb, .xml (MJCF), .robot (packed), and RoboGen's .txt and .json; it writes "
        ".yaml, .yml, .pb, .xml and .urdf.",
        examples=(
            "revolve robot check best.yaml",
            "revolve robot show runs/scenario1-seed1/best.yaml",
            "revolve robot convert best.yaml best.xml --experiment scenario1",
        ),
    )
    commands = flags.add_subparsers(dest="command", required=True, metavar="ACTION")
    for name, what in (
        ("check", "check that a file holds a well-formed robot, and vet its body"),
        ("convert", "convert a robot file to another format (.urdf: the body only)"),
        ("show", "show the body and brain of a robot as a tree"),
    ):
        outputs = (" best.pb", " best.xml") if name == "convert" else ("", "")
        command = commands.add_parser(
            name,
            help=what,
            description=f"{what.capitalize()}.",
            examples=(
                f"revolve robot {name} best.yaml{outputs[0]}",
                f"revolve robot {name} wheeled.yaml{outputs[1]} --experiment mine.toml",
            ),
        )
        command.add_argument(
            "file", type=Path, metavar="FILE|RUN", help="robot file, or run folder"
        )
        if name == "convert":
            command.add_argument(
                "output", type=Path, metavar="OUTPUT", help="robot file to write"
            )
        add_settings(
            command,
            "that in an MJCF or a packed file, else that of the run folder that holds "
            "the file, else all built-in part types and the default world",
        )
        add_plugins(command)
    return flags


def _show_contents(file: Path) -> None:
    """Print the birth of a packed robot, and the plug-ins that it holds."""
    contents, _ = read_archive(file)
    if (origin := contents.origin) is not None:
        parents = ", ".join(each.name for each in origin.parents) or "none"
        birth = f"birth {origin.birth.name} of run {printable(origin.run_id)}"
        print(f"{birth}, parents {parents}, fitness {origin.fitness}")
    for name, digest in contents.plugins.items():
        print(f"plug-in {printable(name)}, source digest {printable(digest)}")


def _summary(robot: Robot, space: BodySpace) -> str:
    """Return the numbers of parts, joints, motors, neurons and connections."""
    brain, parts = robot.brain, counted(len(robot.parts), "part")
    kinds = [(space[part.kind], part.parameters) for part in robot.parts]
    jointed = [kind for kind, values in kinds if kind.shape(values).joint is not None]
    driven = sum(kind.motor is not None for kind in jointed)
    joints = counted(len(jointed), "joint")
    if jointed:
        joints += f", {driven} with {'a motor' if driven == 1 else 'motors'}"
    neurons = [counted(brain.count(layer), layer) for layer in ("input", "output")]
    hidden = counted(brain.count("hidden"), "hidden neuron")
    edges = counted(len(brain.connections), "connection")
    return ", ".join([parts, joints, *neurons, hidden, edges])


def _show(robot: Robot, space: BodySpace, kinds: NeuronKinds, title: str) -> None:
    """Print the parts of a robot as a tree, each with its neurons and their inputs."""
    from rich.console import Console
    from rich.text import Text
    from rich.tree import Tree

    names = neuron_names(robot.brain, [f"part-{i}" for i in range(len(robot.parts))])
    trees: list[Tree] = []
    for index, part in enumerate(robot.parts):
        label = f"part-{index} {part.kind}"
        if index:
            label = (
                f"slot {part.parent_slot}: {label}, by its slot {part.slot}, "
                f"orientation {part.orientation}°"
            )
        own = space[part.kind].own_parameters
        for parameter, value in zip(own, part.parameters, strict=False):
            label += f", {parameter.text(value)}"
        trees.append(Tree(Text(label)))
        if index:
            trees[part.parent].children.append(trees[index])
    for number, neuron in enumerate(robot.brain.neurons):
        own = kinds.get(neuron.kind, ())
        values = ", ".join(
            parameter.text(value)
            for parameter, value in zip(own, neuron.parameters, strict=False)
        )
        kind = f"{neuron.kind}({values})" if values else neuron.kind
        branch = trees[neuron.part].add(Text(f"{names[number]} {kind}", style="cyan"))
        for edge in robot.brain.connections:
            if edge.target == number:
                source = f"<- {edge.weight:g} × {names[edge.source]}"
                branch.add(Text(source, style="dim"))
    console = Console()
    console.print(Text(f"{title}: {_summary(robot, space)}"))
    console.print(trees[0])
