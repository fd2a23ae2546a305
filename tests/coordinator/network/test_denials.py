"""What is said of certificates that a real hub with TLS denies: by owner and by hub."""

import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
import zenoh

from coordinator.cluster.kit import ClusterKit, Kit
from coordinator.network.hub_service import watch_unlisted
from coordinator.network.migration_service import MigrationService, SentRequest
from coordinator.network.operator_service import OperatorQuery
from schema.agent.access import read_certificates
from schema.agent.network import Tls, client_config, hub_config
from schema.agent.service import HubWatch, session_config, usable
from schema.agent.topics import FleetMember, Role
from schema.wire.codec import decode
from schema.wire.migration import MigrantsRequest, Needed
from tests.system.workspace import free_address, wait_until

pytestmark = pytest.mark.system

DENIED = "drops all that this {role} sends: its certificate was revoked, or"


class Lab:
    """A hub in this process, and the kit of its certificates."""

    hub: zenoh.Session

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.address = free_address("tls")
        port = int(self.address.rpartition(":")[2])
        now = datetime.now(UTC)
        clock = [now - timedelta(days=91)]
        kit = Kit.new(
            folder / "lab", ClusterKit("127.0.0.1", port, 90), lambda: clock[0]
        )
        kit.add("late", "worker")
        clock[0] = now
        kit.renew("hub")
        for name in ("good", "gone", "unlisted"):
            kit.add(name, "worker")
        kit.add("chief", "coordinator")
        kit.add("second", "coordinator")
        kit.add("looker", "viewer")
        kit.revoke("gone")
        listed = read_certificates(folder / "lab" / "access.json")
        listed = [each for each in listed if each.name != "unlisted"]
        self.config = hub_config((self.address,), self.tls("hub"), listed)
        foreign = Kit.new(
            folder / "foreign", ClusterKit("127.0.0.1", port, 90), lambda: now
        )
        foreign.add("alien", "worker")

    def tls(self, name: str, kit: str = "lab", authority: str = "") -> Tls:
        own = self.folder / kit / "members" / name
        ca = self.folder / (authority or kit) / "ca.pem"
        return Tls(str(ca), str(own / "certificate.pem"), str(own / "key.pem"))

    def watch(self, tls: Tls, tell: Callable[[str], None]) -> HubWatch:
        return HubWatch(self.address, tell, tell, tls=tls, fleet="lab")


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    made = Lab(tmp_path_factory.mktemp("lab"))
    with zenoh.open(zenoh.Config.from_json5(made.config)) as hub:
        made.hub = hub
        yield made


@pytest.mark.parametrize(
    ("name", "role", "is_denied"),
    [
        ("good", "worker", False),
        ("chief", "coordinator", False),
        ("good", "analyzer", True),
        ("looker", "worker", True),
        ("gone", "worker", True),
        ("unlisted", "coordinator", True),
    ],
)
def test_a_process_says_that_the_hub_drops_what_it_sends(
    lab: Lab, monkeypatch: pytest.MonkeyPatch, name: str, role: Role, *, is_denied: bool
) -> None:
    """Without a coordinator, whose absence is no reason for a warning."""
    if is_denied:
        monkeypatch.setattr(usable, "__defaults__", (0.3,))
    lines: list[str] = []
    tls = lab.tls(name)
    watch = lab.watch(tls, lines.append)
    me = FleetMember("lab", role, f"{name}{'.' if role == 'coordinator' else '-'}0.1")
    with zenoh.open(
        zenoh.Config.from_json5(client_config(lab.address, tls))
    ) as session:
        watch.look(session, me)
        watch.look(session, me)
    if not is_denied:
        assert lines == []
        return
    (line,) = lines
    assert DENIED.format(role=role) in line
    command = f"revolve doctor --connect {lab.address} --fleet lab --tls-ca {tls.ca} "
    files = f"--tls-certificate {tls.certificate} --tls-key {tls.key}"
    assert line.endswith(f"; {command}{files} tells more")


@pytest.mark.parametrize(
    ("name", "kit", "authority", "why"),
    [
        ("late", "lab", "lab", "no TLS connection with certificate 'late': .*expired"),
        ("alien", "foreign", "lab", "no TLS connection with certificate 'alien': "),
        ("alien", "foreign", "foreign", "the hub's certificate is not accepted: "),
        ("good", "lab", "lab", ""),
    ],
)
def test_a_process_says_why_the_hub_refuses_its_certificate(
    lab: Lab, name: str, kit: str, authority: str, why: str
) -> None:
    lines: list[str] = []
    watch = lab.watch(lab.tls(name, kit, authority), lines.append)
    watch.seen(())
    watch.seen(())
    (line,) = lines
    start = f"{lab.address}: {why}" if why else f"no hub at {lab.address}"
    assert re.match(start, line)
    assert "; revolve doctor --connect tls/127.0.0.1:" in line
    assert line.endswith(" tells more; retrying; press Ctrl-C to stop")


def test_the_hub_names_certificates_that_it_does_not_list(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines: list[str] = []
    monkeypatch.setattr("coordinator.network.hub_service.warn_user", lines.append)
    _watch = watch_unlisted(lab.hub, lab.config)
    for name in ("good", "looker", "gone", "unlisted", "gone"):
        config = client_config(lab.address, lab.tls(name))
        zenoh.open(zenoh.Config.from_json5(config)).close()  # type: ignore[no-untyped-call]
    wait_until(lambda: len(lines) >= 2, "both are named")
    told = [line.partition(" is not in --access")[0] for line in lines]
    assert told == ["certificate 'gone'", "certificate 'unlisted'"]


REQUEST = MigrantsRequest("name", b"digest", 0, 1, (Needed(1, 0, 3),))


def migration(lab: Lab, stack: ExitStack, name: str, role: Role) -> MigrationService:
    """Open a session with a certificate, as one of a coordinator would."""
    separator = "." if role == "coordinator" else "-"
    me = FleetMember("lab", role, f"{name}{separator}0.2")
    config = session_config(client_config(lab.address, lab.tls(name)), me)
    return MigrationService(
        stack.enter_context(zenoh.open(config)), me, wake=lambda: None
    )


def test_only_coordinators_ask_each_other_for_migrants(lab: Lab) -> None:
    with ExitStack() as stack:
        one, other = (
            migration(lab, stack, name, "coordinator") for name in ("chief", "second")
        )
        worker = migration(lab, stack, "good", "worker")

        def asked(service: MigrationService) -> list[tuple[str, bytes]]:
            """Ask; return the replies that the hub lets pass."""
            service.ask(REQUEST)
            while True:
                wait_until(lambda: service.has_arrived or other.has_arrived, "a reply")
                for each in other.arrived() if service is not other else []:
                    if isinstance(each, OperatorQuery):
                        assert decode(MigrantsRequest, each.data, 1000) == REQUEST
                        each.reply(b"them")
                for each in service.arrived():
                    if isinstance(each, SentRequest):
                        return each.replies
                    if isinstance(each, OperatorQuery):
                        each.reply()

        assert asked(one) == [("second.0.2", b"them")]
        assert asked(worker) == []
        worker.announce(b"false")
        other.announce(b"news")
        wait_until(lambda: one.has_arrived, "an announcement")
        assert one.arrived() == [b"news"]
