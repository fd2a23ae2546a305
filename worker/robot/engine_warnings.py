"""Warnings of the physics engine."""

from functools import lru_cache

import mujoco
import numpy as np
import numpy.typing as npt


def warning_names(counts: npt.NDArray[np.integer]) -> str:
    """Return the names of the engine's warnings whose counts are not 0."""
    return ", ".join(
        mujoco.mjtWarning(index).name.removeprefix("mjWARN_")
        for index in counts.nonzero()[0].tolist()
    )


@lru_cache(maxsize=1)
def silence_engine() -> None:
    """Keep the engine's warnings out of stderr and of its log file.

    The engine still counts them in ``MjData.warning``.
    """
    mujoco.set_mju_user_warning(lambda _message: None)
