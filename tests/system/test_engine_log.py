"""Zenoh's own log: on standard error, from level "warn", without secrets."""

import socket
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import zenoh

from schema.agent.network import Tls, client_config
from tests.system.workspace import PATIENCE_S, wait_until

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

Workspace = Any


def provoke_warning(address: str, tls: Tls) -> None:
    """Let a query of a client time out at another one, which a hub warns of."""
    held: list[zenoh.Query] = []
    with ExitStack() as stack:
        one, two = (
            stack.enter_context(
                zenoh.open(zenoh.Config.from_json5(client_config(address, tls)))
            )
            for _ in range(2)
        )
        handler = zenoh.handlers.Callback(held.append, indirect=False)
        with one.declare_queryable("other/key", handler):
            end_s = time.monotonic() + PATIENCE_S
            while not held:
                assert time.monotonic() < end_s
                list(two.get("other/key", timeout=0.2))
            # The hub may see the end of a query before it notices the delay.
            for _ in range(5):
                list(two.get("other/key", timeout=0.2))
            held.clear()


@pytest.mark.slow
def test_engine_warns_on_standard_error_and_shows_no_secret(
    workspace: Workspace, certify: Callable[[Path, str, str, str], Tls]
) -> None:
    tls = certify(workspace.folder, "node", "authority", "127.0.0.1")
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tls/127.0.0.1:{server.getsockname()[1]}"
    files = (
        "--tls-ca", tls.ca, "--tls-certificate", tls.certificate, "--tls-key", tls.key,
    )  # fmt: skip
    words = ("run", "scenario1", "--births", "90", "--workers", "1", "--out", "run")
    process = workspace.start(
        *words, "--quiet", "--listen", address, *files,
        environment={"RUST_LOG": "trace"},
    )  # fmt: skip
    wait_until((workspace.folder / "run" / "address").exists, "the coordinator listens")
    provoke_warning(address, tls)
    out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, err
    assert out.startswith("90 births; ")
    assert "zenoh" not in out
    assert "WARN" in err
    assert "zenoh::" in err
    for level in ("INFO", "DEBUG", "TRACE"):
        assert level not in err
    key = Path(tls.key).read_text().splitlines()[1:-1]
    assert len(key) > 10
    assert not [line for line in key if line in out + err]
