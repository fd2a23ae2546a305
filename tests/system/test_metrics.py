"""Progress of a run for programs: metrics, and the status as JSON."""

import json
import re
from urllib.request import urlopen

import pytest

from tests.system.workspace import Workspace, wait_until

pytestmark = pytest.mark.system


def test_metrics_and_json_status_of_a_run_that_waits(workspace: Workspace) -> None:
    words = ("--listen", "tcp/127.0.0.1:0", "--metrics", "127.0.0.1:0")
    run = workspace.start("coordinator", "scenario1", "--out", "run", *words)
    lines = iter(run.stderr.readline, "")
    url = next(
        match[0] for line in lines if (match := re.search(r"http://\S+/metrics", line))
    )

    def shown() -> str:
        with urlopen(url, timeout=10) as answer:  # noqa: S310 - of this machine
            return str(answer.read().decode("utf-8"))

    wait_until(
        lambda: (
            'revolve_jobs_waiting{kind="analyzer"} 0.0' not in shown()
            and 'revolve_jobs_waiting{kind="analyzer"}' in shown()
        ),
        "a run without analyzers has a queue",
    )
    assert 'revolve_runs{state="running"} 1.0' in shown()
    status = workspace.run("status", "run", "--json")
    (one,) = json.loads(status)["coordinators"]
    assert one["name"].startswith("coordinator")
    assert one["runs"][0]["state"] == "running"
    waiting = {queue["kind"]: queue["waiting"] for queue in one["queues"]}
    assert waiting["analyzer"] > 0
    assert waiting["worker"] == 0
