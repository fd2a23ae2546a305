"""Plug-ins of requests are checked by the worker, too."""

import msgspec
import pytest
from msgspec.structs import replace

import worker.measures
from schema.errors import ExperimentError
from schema.experiment.document import Measures
from schema.experiment.file import read_experiment
from schema.experiment.settings import evaluation_settings_of
from worker.serve.checks import checked_evaluation

SETTINGS = evaluation_settings_of(read_experiment("scenario1"))


def test_unknown_measure_is_refused() -> None:
    settings = replace(SETTINGS, measures=Measures(names=("height", "turnin")))
    with pytest.raises(ExperimentError, match=r"did you mean 'turning'\?"):
        checked_evaluation(msgspec.json.encode(settings))


def test_faulty_measure_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(worker.measures.BUILT_IN, "faulty", lambda _trace: float("nan"))
    settings = replace(SETTINGS, measures=Measures(names=("height", "faulty")))
    with pytest.raises(ExperimentError, match=r"test_checks.py:\d+: must return a fin"):
        checked_evaluation(msgspec.json.encode(settings))
