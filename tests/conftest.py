"""Set-up that precedes all other imports of the tests."""

import os
from contextlib import suppress

from hypothesis import settings

from analysis.render.picture import NoPictures, choose_engine

# MuJoCo settles what draws when it is first imported, and some test or other imports
# it first. Processes that tests start choose for themselves.
_SETTING = os.environ.get("MUJOCO_GL")
with suppress(NoPictures):
    choose_engine()
import mujoco  # noqa: E402, F401

if _SETTING is None:
    os.environ.pop("MUJOCO_GL", None)

# The same examples every time, however slow the machine: a test that fails by luck
# teaches nothing. Here, for tests take the settings that hold when they are decorated.
settings.register_profile("fixed", derandomize=True, database=None, deadline=None)
settings.load_profile("fixed")
