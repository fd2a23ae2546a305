"""Own neurons, brains and sensors in experiments."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from schema.errors import ExperimentError, RevolveError
from schema.experiment.brains import neuron_kinds, neuron_types
from schema.experiment.document import NETWORK, BrainSection, Space, references
from schema.experiment.file import experiment_from_text, experiment_text
from schema.experiment.kinds import KINDS, SENSOR, Use, kind_of
from schema.experiment.settings import evaluation_settings, evaluation_settings_of
from schema.formats.files import read_robot, write_robot
from schema.plugins import permission
from schema.plugins.permission import allow
from schema.robot.brain import NEURON_TYPES, Brain, Neuron
from schema.robot.robot import Part
from tests.documents import parse_experiment
from tests.schema.robots import GREY, robot_of

own = pytest.mark.usefixtures("_own_brains")
TIRED = '[space]\nneuron_types = ["Sigmoid", "my_brains:Adapting"]\n'
WAVES = '[brain]\ntype = "my_brains:Wave"\n[brain.parameters]\nfrequency_hz = 2\n'


def parse(text: str, where: str = "mine.toml") -> object:
    return parse_experiment(f'name = "x"\n{text}', where)


def test_the_default_is_the_thesis() -> None:
    names = [kind.name for kind in neuron_types(Space().neuron_types)]
    assert names == list(NEURON_TYPES)
    assert neuron_kinds(NETWORK, Space()) == NEURON_TYPES


@own
def test_own_types_are_named_in_documents_requests_and_references() -> None:
    experiment = parse_experiment(f'name = "x"\n{TIRED}{WAVES}', "x.toml")
    assert {"my_brains:Adapting", "my_brains:Wave"} <= set(references(experiment))
    assert experiment_from_text(experiment_text(experiment)) == experiment
    assert b'"my_brains:Wave"' in evaluation_settings(experiment)
    assert list(neuron_kinds(experiment.brain, experiment.space)) == ["Waver"]
    tired = neuron_kinds(NETWORK, experiment.space)
    assert list(tired) == ["Sigmoid", "Adapting"]
    assert [each.name for each in tired["Adapting"]] == ["rise_s", "fatigue", "drive"]


@own
def test_robots_with_own_neurons_are_written_and_read(tmp_path: Path) -> None:
    experiment = parse_experiment(f'name = "x"\n{TIRED}', "x.toml")
    kinds = neuron_kinds(experiment.brain, experiment.space)
    plain = robot_of(Part("ActiveHinge", 0, 0, 0, 0, GREY))
    adapting = Neuron("output", "Adapting", 1, (0.5, 0.1, 0.25))
    robot = replace(plain, brain=Brain((*plain.brain.neurons[:6], adapting)))
    for ending in ("yaml", "pb", "xml"):
        file = tmp_path / f"robot.{ending}"
        settings = evaluation_settings_of(experiment)
        write_robot(robot, file, settings)
        assert read_robot(file, kinds=kinds) == robot
        with pytest.raises(RevolveError, match="one of Simple, ") as caught:
            read_robot(file)
        assert "'Adapting'" in str(caught.value)
    assert "fatigue: 0.1" in (tmp_path / "robot.yaml").read_text()


@own
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[brain]\ntype = "cpgs"', "type: must be one of network, cpg, modular or "),
        ('[brain]\ntype = "cpgs"', "did you mean 'cpg'"),
        ('[brain]\ntype = "my_brains:Waves"', r"brain\.type: my_brains\.py:\d+: "),
        ('[brain]\ntype = "my_brains:Wav"', "did you mean 'my_brains:Wave"),
        ('[brain]\ntype = "my_brains:np"', "has no 'outputs'"),
        ('[brain]\ntype = "my_brains:Adapting"', "has no 'outputs'"),
        ("[brain]\nparameters = {a = 1}", r"brain\.parameters\.a: no such key"),
        (WAVES.replace("2", '"fast"'), r"brain.parameters.frequency_hz: must be a nu"),
        ("[space]\nneuron_types = []", "must name at least one type"),
        ('[space]\nneuron_types = ["Simpel"]', "did you mean 'Simple'"),
        ('[space]\nneuron_types = ["Simple", "Simple"]', "two types are named 'Simpl"),
        (
            '[space]\nneuron_types = ["my_brains:Wave"]',
            "raised TypeError: .* missing 2",
        ),
        ('[space]\nneuron_types = ["my_brains:np"]', "raised AttributeError: .*'name'"),
    ],
)
def test_a_wrong_name_or_object_is_refused(text: str, message: str) -> None:
    with pytest.raises(ExperimentError, match=message) as caught:
        parse(text)
    assert "\n" not in str(caught.value)


def test_a_module_that_is_not_allowed_is_not_imported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(permission, "_allowed", {})
    with pytest.raises(ExperimentError, match="module 'intruder' is not allowed"):
        neuron_kinds(BrainSection(type="intruder:Brain"), Space())
    with pytest.raises(ExperimentError, match="module 'intruder' is not allowed"):
        neuron_types(("intruder:Neuron",))


MODULE = '''"""Two sensors."""


class Nose:
    """Sensor of one input."""

    inputs = 1

    def read(self, view):
        """Return how near the ground is."""
        return (1.0 - view.distance("tip", (0.0, 0.0, -1.0), 0.5) / 0.5,)


class Drip(Nose):
    """Sensor of a value too many."""

    def read(self, view):
        """Return two values."""
        return (*super().read(view), 0.0)


NOSE, DRIP = Nose(), Drip()
'''


def test_a_sensor_is_recognised_and_checked(tmp_path: Path) -> None:
    file = tmp_path / "noses_of_a_user.py"
    file.write_text(MODULE)
    allow([str(file)])
    use = Use(SENSOR, "noses_of_a_user:NOSE")
    plugin = SENSOR.load(use.path)
    assert kind_of(plugin, KINDS) is SENSOR
    assert kind_of(type(plugin), KINDS) is None
    assert use.check() == ("noses_of_a_user.py:22", "")
    message = r"sensor: noses_of_a_user.py.*must return 1 values, its inputs, got 2"
    with pytest.raises(ExperimentError, match=message):
        Use(SENSOR, "noses_of_a_user:DRIP").check()
    with pytest.raises(ExperimentError, match="has no 'inputs'"):
        SENSOR.load("schema.parts:SERVO")
