"""What one process asks of the system for itself and for all that it starts."""

import subprocess
import sys

import pytest

_ASK = "import os; print(os.sched_getscheduler(0) == os.SCHED_{policy})"
_START = (
    "import subprocess, sys\n"
    "from schema.crew import one_thread_each\n"
    "{before}\n"
    "one_thread_each()\n"
    "{ask}\n"
    "subprocess.run([sys.executable, '-c', {ask!r}], check=True)\n"
)

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="other systems have no such policies"
)


def _said(policy: str, before: str = "") -> list[str]:
    """Return whether a process and its child have a policy, in their words."""
    text = _START.format(before=before, ask=_ASK.format(policy=policy))
    done = subprocess.run(
        [sys.executable, "-c", text], check=True, capture_output=True, text=True
    )
    return done.stdout.split()


def test_nobody_who_wakes_up_interrupts_who_computes() -> None:
    assert _said("BATCH") == ["True", "True"]


def test_a_policy_of_the_user_s_own_stays() -> None:
    idle = "import os; os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))"
    assert _said("IDLE", idle) == ["True", "True"]
