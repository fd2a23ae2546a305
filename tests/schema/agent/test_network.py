"""Addresses and configurations of hubs, and what is told when one is gone."""

import json
from typing import Any

import pytest
import zenoh

from schema.agent.address import parse_address
from schema.agent.network import Tls, client_config, hub_config
from schema.agent.service import HubLost, HubWatch
from schema.errors import NetworkError

THIS_MACHINE = "tcp/127.0.0.1:0"
TLS = Tls("ca.pem", "own.pem", "own.key")


def hub(*listen: str, tls: Tls | None = None) -> Any:  # noqa: ANN401 - JSON
    return json.loads(hub_config(listen, tls))


@pytest.mark.parametrize(
    ("address", "parsed"),
    [
        ("tcp/127.0.0.1:7447", ("tcp", "127.0.0.1", 7447)),
        ("tls/hub.example:0", ("tls", "hub.example", 0)),
        ("tcp/[::1]:65535", ("tcp", "::1", 65535)),
    ],
)
def test_addresses(address: str, parsed: tuple[str, str, int]) -> None:
    assert parse_address(address) == parsed


@pytest.mark.parametrize(
    "address",
    ["", "7447", "host:7447", "udp/h:1", "tcp/h", "tcp/h:", "tcp/h:65536", "tcp/h:1#x"],
)
def test_invalid_addresses_are_refused(address: str) -> None:
    with pytest.raises(NetworkError, match="must be tcp/HOST:PORT"):
        parse_address(address)


@pytest.mark.parametrize(
    "address", [THIS_MACHINE, "tcp/localhost:1", "tcp/[::1]:1", "tcp/127.8.8.8:1"]
)
def test_hub_on_this_machine_needs_no_certificates(address: str) -> None:
    assert hub(address)["listen"]["endpoints"] == [address]


@pytest.mark.parametrize(
    "address", ["tcp/0.0.0.0:1", "tcp/[::]:1", "tcp/192.168.1.2:1", "tcp/hub.example:1"]
)
@pytest.mark.parametrize("tls", [None, TLS])
def test_hub_for_other_machines_needs_tls(address: str, tls: Tls | None) -> None:
    with pytest.raises(NetworkError, match="beyond this machine without protection"):
        hub_config((THIS_MACHINE, address), tls)


def test_tls_needs_its_files_and_explicit_ports() -> None:
    with pytest.raises(NetworkError, match=r"tls/h:1 needs --tls-ca"):
        hub_config(("tls/h:1",))
    with pytest.raises(NetworkError, match=r"tls/h:1 needs --tls-ca"):
        client_config("tls/h:1")
    with pytest.raises(NetworkError, match="each address needs a port"):
        hub_config((THIS_MACHINE, "tls/h:1"), TLS)


def test_tls_hub_requires_certificates_and_has_no_admin_space() -> None:
    config = hub("tcp/127.0.0.1:7447", "tls/0.0.0.0:7448", tls=TLS)
    link = config["transport"]["link"]
    assert link["protocols"] == ["tcp", "tls"]
    assert link["tls"]["enable_mtls"] is True
    assert config["adminspace"]["enabled"] is False


@pytest.mark.parametrize(
    "text",
    [
        hub_config((THIS_MACHINE,)),
        hub_config(("tls/h:1",), TLS),
        client_config("tcp/h:1"),
        client_config("tls/h:1", TLS),
    ],
)
def test_engine_accepts_the_configurations_without_scouting(text: str) -> None:
    zenoh.Config.from_json5(text)  # raises on a key that it does not know
    config = json.loads(text)
    assert config["scouting"]["multicast"]["enabled"] is False
    assert config["scouting"]["gossip"]["enabled"] is False
    assert config["transport"]["shared_memory"]["enabled"] is False


@pytest.mark.parametrize(
    ("tells_first", "seen", "told"),
    [
        (True, ["a", "a"], ["connected to hub"]),
        (False, ["a", "a"], []),
        (True, ["", "a"], ["gone", "connected to hub"]),
        (False, ["", "a"], ["gone", "connected to hub"]),
        (True, ["a", "", "", "a"], ["connected to hub", "lost", "back"]),
        (False, ["a", "", "b", "b"], ["lost", "back"]),
        (False, ["a", "b", "b"], ["lost", "back"]),
    ],
)
def test_it_tells_when_the_hub_comes_and_goes(
    *, tells_first: bool, seen: list[str], told: list[str]
) -> None:
    lines: list[str] = []
    watch = HubWatch("hub", lines.append, lines.append, tells_first=tells_first)
    for hubs in seen:
        watch.seen(hubs)
    names = {
        "no hub at hub; retrying; press Ctrl-C to stop": "gone",
        "no hub at hub (it ended, or the network is down); retrying; "
        "press Ctrl-C to stop": "lost",
        "reconnected to hub": "back",
    }
    assert [names.get(line, line) for line in lines] == told


def test_it_tells_again_when_the_reason_changes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A hub that comes back may refuse this process; it is looked for every 10 s."""
    clock, reason = [0.0], [""]
    lines: list[str] = []
    monkeypatch.setattr("schema.agent.service.time.monotonic", lambda: clock[0])
    monkeypatch.setattr(
        "schema.agent.service.why_no_hub",
        lambda address, _tls, gone: reason[0] or f"no hub at {address}{gone}",
    )
    files = Tls("ca", "own", "key")
    watch = HubWatch("tls/h:1", lines.append, lines.append, tls=files)
    for now_s, why in ((0.0, ""), (11.0, ""), (12.0, "expired"), (22.0, "expired")):
        clock[0], reason[0] = now_s, why
        watch.seen(())
    first, second = (line.partition(";")[0] for line in lines)
    assert (first, second) == ("no hub at tls/h:1", "expired")


def test_it_gives_up_after_the_time() -> None:
    watch = HubWatch("hub", print, print, give_up_after_s=0.0)
    watch.seen(())
    with pytest.raises(HubLost, match="no hub at hub for 0 s: giving up"):
        watch.seen(())
