"""Experiments of TOML texts, as if a user had written them."""

import pytest

from schema.errors import ExperimentError
from schema.experiment.document import Experiment
from schema.experiment.file import read_experiment
from schema.plugins.bounded import parse_toml


def parse_experiment(text: str, where: str) -> Experiment:
    return read_experiment(parse_toml(text, where), where)


def parse(text: str) -> Experiment:
    """Return the experiment of some sections."""
    return parse_experiment(f'name = "test"\n{text}', "test.toml")


def check_refused(text: str, message: str) -> None:
    """Check that sections are refused, with a message in one line."""
    with pytest.raises(ExperimentError, match=message) as caught:
        parse(text)
    assert "\n" not in str(caught.value)
