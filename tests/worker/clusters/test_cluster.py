"""Order of the engine's arrays in memory, of which clusters copy a block."""

from typing import Any

import mujoco
import numpy as np
import pytest

import worker.__main__
from schema.errors import RevolveError
from worker.clusters.cluster import check_layout

MESSAGE = (
    rf"^MuJoCo {mujoco.__version__} orders the arrays of a state in another way than "
    "arenas need: install mujoco-core 4.0$"
)


class Rearranged:
    """State of an engine whose arrays are in other places of its memory.

    Attributes:
        nbuffer: bytes of the memory block.
    """

    def __init__(self, *starts: int, nbuffer: int = 8 * 100) -> None:
        memory = np.zeros(100)
        sizes = {"qpos": 7, "qvel": 6, "xpos": 6, "xmat": 18}
        for (name, size), start in zip(sizes.items(), starts, strict=True):
            setattr(self, name, memory[start : start + size])
        self.nbuffer = nbuffer


def use(monkeypatch: pytest.MonkeyPatch, data: Rearranged) -> None:
    """Let the engine make this state of any model."""
    made: Any = lambda _model: data  # noqa: E731
    monkeypatch.setattr(mujoco, "MjData", made)


def test_installed_engine_has_the_order_that_clusters_need() -> None:
    check_layout()


def test_known_order_is_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, Rearranged(0, 10, 40, 60, nbuffer=8 * 78))
    check_layout()


@pytest.mark.parametrize(
    "data",
    [
        Rearranged(0, 40, 10, 60),
        Rearranged(60, 0, 10, 40),
        Rearranged(0, 10, 40, 60, nbuffer=8 * 77),
    ],
    ids=["velocities after positions of bodies", "positions last", "another block"],
)
def test_another_order_stops_a_worker_before_any_job(
    monkeypatch: pytest.MonkeyPatch, data: Rearranged
) -> None:
    use(monkeypatch, data)
    with pytest.raises(RevolveError, match=MESSAGE):
        worker.__main__.main(["worker", "--connect", "nowhere"])
