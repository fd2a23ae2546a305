"""Roles of certificates at a real hub, and processes of one user without flags."""

import json
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
import zenoh

from coordinator.cluster.kit import ClusterKit, Kit, MemberRole
from coordinator.storage.compare import compare
from schema.agent.network import Tls, client_config
from tests.system.documents import SCENARIO1
from tests.system.fleet import alive, kit_files, make_kit, tls_flags
from tests.system.workspace import (
    Process,
    Workspace,
    free_address,
    runtime_directory,
    wait_until,
)

pytestmark = pytest.mark.system

ROLES: dict[str, MemberRole] = {
    "chief": "coordinator",
    "good": "worker",
    "bad": "worker",
    "judge": "analyzer",
    "looker": "viewer",
    "boss": "operator",
}
RUN = (*SCENARIO1, "--out", "run")


class Lab:
    """A hub with access rules, and the kit of all certificates."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self.address = free_address("tls")
        self.folder = workspace.folder / "run"
        self.kit = make_kit(workspace.folder / "lab", **ROLES)
        self.hub = self.start("hub", "hub", "--access", "lab/access.json")
        assert "listening on tls/" in self.hub.stderr.readline()

    def start(self, name: str, *words: str) -> Process:
        where = "--listen" if words[0] == "hub" else "--connect"
        files = tls_flags(kit_files(self.kit.folder, name))
        return self.workspace.start(*words, where, self.address, *files)

    def session(self, name: str) -> zenoh.Session:
        return self.session_of(kit_files(self.kit.folder, name))

    def session_of(self, tls: Tls) -> zenoh.Session:
        config = client_config(self.address, tls)
        return zenoh.open(zenoh.Config.from_json5(config))


@pytest.fixture
def lab(workspace: Workspace) -> Lab:
    return Lab(workspace)


def replies(session: zenoh.Session, key: str, payload: bytes = b"") -> list[bytes]:
    """Return the replies to a query, errors included."""
    found = session.get(
        key, payload=payload, timeout=1.0, consolidation=zenoh.ConsolidationMode.NONE
    )
    return [
        (reply.ok or reply.err).payload.to_bytes()  # type: ignore[union-attr]
        for reply in found
    ]


def test_certificates_act_in_their_role_only(lab: Lab, undisturbed: Path) -> None:
    coordinator = lab.start("chief", "coordinator", *RUN)
    lab.start("good", "worker", "--processes", "1")
    with ExitStack() as stack:
        head, operator, viewer, liar, spy = (
            stack.enter_context(lab.session(name))
            for name in ("chief", "boss", "looker", "bad", "bad")
        )
        wait_until(lambda: bool(alive(operator, "coordinator")), "the coordinator")
        wait_until(lambda: bool(alive(head, "worker")), "the worker")
        (chief,), (good,) = alive(operator, "coordinator"), alive(head, "worker")
        # Nothing is born without an analyzer: the liar has all the time it wants.
        forged = (
            chief.alive.replace(chief.name, "chief.00000000"),
            "revolve/default/an/bad-0.1/alive",
            good.alive.replace(good.name, "good-0.00000000"),
            "revolve/default/w/bad-0.1/alive",
        )
        kept = [liar.liveliness().declare_token(key) for key in forged]
        stolen = liar.declare_queryable(
            good.jobs, lambda query: query.reply(query.key_expr, b"forged")
        )
        heard: list[zenoh.Sample] = []
        ears = spy.declare_subscriber("revolve/**", heard.append)
        liar.put(good.cancelled, b"forged")
        # The one token that its certificate allows is there, so the others were sent.
        wait_until(lambda: len(alive(head, "worker")) == 2, "the liar's own token")
        assert {each.name for each in alive(head, "worker")} == {
            good.name, "bad-0.1",
        }  # fmt: skip
        assert alive(head, "analyzer") == []
        assert alive(operator, "coordinator") == [chief]
        kept[-1].undeclare()  # type: ignore[no-untyped-call]
        assert replies(spy, good.jobs) == []
        assert replies(spy, chief.command) == []
        assert replies(spy, chief.state) == []
        assert replies(viewer, chief.command) == []
        assert replies(viewer, good.info) == []
        assert len(replies(viewer, chief.state)) == 1
        assert len(replies(operator, chief.command)) == 1
        lab.start("judge", "analyzer")
        wait_until(lambda: coordinator.poll() is not None, "the run ends")
        stolen.undeclare()  # type: ignore[no-untyped-call]
        ears.undeclare()  # type: ignore[no-untyped-call]
        assert heard == []
    assert coordinator.returncode == 0
    assert compare(lab.folder, undisturbed) == []


def test_strangers_do_not_connect(lab: Lab) -> None:
    foreign = make_kit(lab.folder / "foreign", stranger="worker")
    stranger = kit_files(foreign.folder, "stranger")
    ours = kit_files(lab.kit.folder, "good").ca
    with pytest.raises(zenoh.ZError):
        lab.session_of(Tls(ours, stranger.certificate, stranger.key))
    config = json.loads(client_config(lab.address, Tls(ours, "", "")))
    shown = {"root_ca_certificate": ours, "enable_mtls": False}
    config["transport"]["link"]["tls"] = shown
    with pytest.raises(zenoh.ZError):
        zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
    # The hub has read the list without it.
    lab.kit.add("unlisted", "worker")
    with lab.session("unlisted") as nobody, lab.session("chief") as head:
        nobody_token = nobody.liveliness().declare_token(
            "revolve/default/w/unlisted-0.1/alive"
        )
        with lab.session("bad") as known:
            token = known.liveliness().declare_token("revolve/default/w/bad-0.1/alive")
            wait_until(lambda: bool(alive(head, "worker")), "the known one's token")
            assert [each.name for each in alive(head, "worker")] == ["bad-0.1"]
            token.undeclare()  # type: ignore[no-untyped-call]
        nobody_token.undeclare()  # type: ignore[no-untyped-call]


def test_three_commands_of_one_user_need_no_address(
    workspace: Workspace, undisturbed: Path
) -> None:
    place = {
        "XDG_RUNTIME_DIR": runtime_directory(workspace.folder),
        "REVOLVE_CONNECT": "",
    }
    coordinator = workspace.start("coordinator", *RUN, environment=place)
    workspace.start("worker", "--processes", "1", environment=place)

    def status() -> str:
        text: str = workspace.start("status", environment=place).communicate()[0]
        return text

    # Without an analyzer the run cannot end before the second one starts.
    wait_until(lambda: "1 worker" in status(), "the worker has joined")
    second = workspace.start(
        "coordinator", *RUN[:-1], "second", environment=place
    ).communicate()[1]
    assert "in use; to share its workers: --connect unixsock-stream/" in second
    workspace.start("analyzer", "--processes", "1", environment=place)
    wait_until(lambda: coordinator.poll() is not None, "the run ends")
    assert coordinator.returncode == 0
    assert compare(workspace.folder / "run", undisturbed) == []


def test_name_of_an_agent_is_that_of_its_certificate(lab: Lab) -> None:
    process = lab.start("good", "worker", "--name", "other")
    assert process.wait(60) == 2
    assert "--name: must be 'good', the name of " in process.stderr.read()


def test_hub_closes_links_when_their_certificate_expires(workspace: Workspace) -> None:
    """One certificate has expired when the hub starts, one expires while connected."""
    folder = workspace.folder / "lab"
    start = datetime.now(UTC)
    clock = [start]
    kit = Kit.new(folder, ClusterKit("127.0.0.1", 7447, 1), lambda: clock[0])
    kit.add("good", "worker")
    for name, left_s in (("late", -5.0), ("brief", 20.0)):
        clock[0] = start - timedelta(days=1) + timedelta(seconds=left_s)
        kit.add(name, "worker")
    address = free_address("tls")
    words = ("hub", "--listen", address, "--access", str(folder / "access.json"))
    hub = workspace.start(*words, *tls_flags(kit_files(folder, "hub")))
    assert "listening on tls/" in hub.stderr.readline()

    def opened(name: str) -> zenoh.Session:
        config = client_config(address, kit_files(folder, name))
        return zenoh.open(zenoh.Config.from_json5(config))

    with pytest.raises(zenoh.ZError):
        opened("late")
    with opened("brief") as brief, opened("good") as good:
        assert list(brief.info.routers_zid())
        wait_until(lambda: not list(brief.info.routers_zid()), "the link is closed")
        assert datetime.now(UTC) >= start + timedelta(seconds=19)
        assert list(good.info.routers_zid())
        with pytest.raises(zenoh.ZError):
            opened("brief")
