"""What real processes write: log lines, also of the engine, metrics and status."""

import json
import re
from pathlib import Path
from urllib.request import urlopen

import pytest
import zenoh

from schema.agent.network import Tls, client_config
from tests.system.fleet import kit_files, make_kit, tls_flags
from tests.system.workspace import (
    PATIENCE_S,
    Workspace,
    address_of,
    free_address,
    wait_until,
)

pytestmark = pytest.mark.system

KEYS = {"time", "level", "process", "pid", "message"}


def test_all_lines_of_a_run_are_json(workspace: Workspace) -> None:
    run = ("run", "scenario1", "--births", "16", "--workers", "1", "--out", "run")
    process = workspace.start(*run, "--log-json", "--listen", "tcp/127.0.0.1:0")
    out, err = process.communicate(timeout=200)
    assert process.returncode == 0, err
    entries = [json.loads(line) for line in err.splitlines()]
    assert all(entry.keys() == KEYS for entry in entries)
    assert any("listening on tcp/" in entry["message"] for entry in entries)
    assert {entry["process"] for entry in entries} == {"coordinator"}
    assert "births" in out


def test_an_error_at_the_end_is_a_line_of_the_log(workspace: Workspace) -> None:
    words = ("coordinator", "scenario1", "--listen", "tcp/192.0.2.1:1", "--log-json")
    process = workspace.start(*words)
    _, err = process.communicate(timeout=200)
    assert process.returncode == 2
    (line,) = err.splitlines()
    entry = json.loads(line)
    assert entry["level"] == "error"
    assert "192.0.2.1" in entry["message"]


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


def provoke_warning(address: str, tls: Tls) -> None:
    """Connect to a hub under the hub's own id, of which it warns."""
    config = zenoh.Config.from_json5(client_config(address, tls))
    with zenoh.open(config) as session:
        (hub,) = session.info.routers_zid()
    config = zenoh.Config.from_json5(client_config(address, tls))
    config.insert_json5("id", json.dumps(str(hub)))
    with pytest.raises(zenoh.ZError, match="Unable to connect"):
        zenoh.open(config)


@pytest.mark.slow
def test_engine_warns_on_standard_error_and_shows_no_secret(
    workspace: Workspace,
) -> None:
    tls = kit_files(make_kit(workspace.folder / "lab").folder, "hub")
    address, files = free_address("tls"), tls_flags(tls)
    words = ("run", "scenario1", "--births", "90", "--workers", "1", "--out", "run")
    process = workspace.start(
        *words, "--quiet", "--listen", address, *files,
        environment={"RUST_LOG": "trace"},
    )  # fmt: skip
    address_of(workspace.folder / "run")
    provoke_warning(address, tls)
    out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, err
    assert out.startswith("90 births; ")
    assert "zenoh" not in out
    assert "WARN" in err
    assert "zenoh_transport::" in err
    for level in ("INFO", "DEBUG", "TRACE"):
        assert level not in err
    key = Path(tls.key).read_text().splitlines()[1:-1]
    assert len(key) >= 3
    assert not [line for line in key if line in out + err]
