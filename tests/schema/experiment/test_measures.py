"""The section ``[measures]`` of an experiment."""

import pytest

from schema.errors import ExperimentError
from schema.experiment.check import check_experiment
from schema.experiment.document import Experiment, Measures, references
from tests.documents import parse_experiment

TEXT = """
name = "a"
[measures]
names = ["height", "my_lab:limp"]
[measures.parameters.limp]
above_m = 0.5
"""


def test_names_and_parameters_are_read() -> None:
    found = parse_experiment(TEXT, "a.toml")
    assert found.measures == Measures(
        names=("height", "my_lab:limp"), parameters={"limp": {"above_m": 0.5}}
    )
    assert found.measures.labels == ("height", "limp")


def test_only_own_measures_name_modules() -> None:
    found = references(parse_experiment(TEXT, "a.toml"))
    assert "my_lab:limp" in found
    assert "height" not in found


@pytest.mark.parametrize(
    ("measures", "message"),
    [
        (Measures(names=("limp", "my_lab:limp")), "two measures are named 'limp'"),
        (
            Measures(names=("height",), parameters={"heigth": {}}),
            r"measures.parameters.'heigth': is not in .* did you mean 'height'\?",
        ),
    ],
)
def test_inconsistent_measures_are_refused(measures: Measures, message: str) -> None:
    with pytest.raises(ExperimentError, match=message):
        check_experiment(Experiment(name="a", measures=measures), "a.toml")
