"""Tests of sensors as a kind of plug-in that ``revolve check`` checks."""

from pathlib import Path

import pytest

from schema.errors import ExperimentError
from schema.experiment.kinds import KINDS, SENSOR, Use, kind_of
from schema.plugins.permission import allow

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
