"""Zenoh's own log: on standard error, from level "warn", without secrets."""

import json
from pathlib import Path

import pytest
import zenoh

from schema.agent.network import Tls, client_config
from tests.system.fleet import kit_files, make_kit, tls_flags
from tests.system.workspace import PATIENCE_S, Workspace, address_of, free_address

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]


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
