"""The loop in which workers and analyzers do jobs from the network.

An agent does one job at a time; the next one already waits within the process. The
callbacks of the network only enqueue. Bad requests are refused with a reason and
counted; they never end the loop.
"""

import json
import math
import os
import shlex
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import zenoh

from schema.agent.inbox import Inbox
from schema.agent.job_service import WaitingJobs
from schema.agent.log import start_log, tell_user, warn_user
from schema.agent.machine import (
    memory_bytes,
    platform_tag,
    shards_that_fit,
    wire_version,
)
from schema.agent.network import DEFAULT_FLEET, UNFIT, Agent, Tls, client_config
from schema.agent.request_handler import Compute, ReplyCounts, Server
from schema.agent.supervision import LOOK_S, ProcessSlot
from schema.agent.supervisor import (
    AGENT_THREADS,
    HUB_THREADS,
    stop_on_signals,
    stop_with_parent,
)
from schema.agent.topics import FleetMember, check_name, unique_name
from schema.errors import NetworkError, counted
from schema.limits import MOST_SHOWN, printable
from schema.plugins.permission import allow

_RETRY_S = 0.3
# Between two messages to this process itself, and two looks why a hub refuses it.
_BETWEEN_S, _TELL_AGAIN_S = 0.02, 10.0
_MOST_REFUSALS = 20  # Different lines about refused runs that are written.
_OPENING = threading.Lock()  # One at a time: threads share the environment.

GAVE_UP = 75
"""Exit status of a process that gave up for lack of a hub (EX_TEMPFAIL)."""
UNSUPERVISED = ProcessSlot()
"""Slot of a process without a supervisor."""


_ENGINE_LOG = (
    "warn,zenoh::net::runtime::orchestrator=error,zenoh_link_unixsock_stream=error,"
    "zenoh::net::routing::dispatcher::queries=error,zenoh::api::session=error"
)
"""Levels of Zenoh's log.

The commands themselves tell of a hub that is missing. Queries whose time is over are
normal, and so are replies to them: the job is sent again.
"""


def open_session(config: zenoh.Config, *, is_agent: bool = False) -> zenoh.Session:
    """Return a new session; Zenoh logs on descriptor 1, at level "warn".

    RUST_LOG has no effect: at lower levels the log shows secrets. Commands lead the
    descriptor to standard error, see ``revolve.command.main``. ZENOH_RUNTIME has none:
    with some values a hub cannot forward, with others the engine panics.

    Raises:
        zenoh.ZError: no hub answers, or an address cannot be listened on.
    """
    names = ("RUST_LOG", "ZENOH_RUNTIME")
    with _OPENING:
        chosen = {name: os.environ.pop(name) for name in names if name in os.environ}
        # Read when a process opens its first session.
        os.environ["ZENOH_RUNTIME"] = AGENT_THREADS if is_agent else HUB_THREADS
        try:
            zenoh.init_log_from_env_or(_ENGINE_LOG)
            return zenoh.open(config)
        finally:
            del os.environ["ZENOH_RUNTIME"]
            os.environ.update(chosen)


def session_config(text: str, member: FleetMember) -> zenoh.Config:
    """Return the configuration of a process's session, with its id."""
    config = zenoh.Config.from_json5(text)
    config.insert_json5("id", json.dumps(member.session))
    return config


class HubLost(NetworkError):  # noqa: N818 - reads as what it says
    """No hub has answered for the time after which the process gives up."""


@dataclass(slots=True)
class HubWatch:
    """Presence of the hub, as the user was told.

    Attributes:
        say: called with a line when the hub is back.
        warn: called with a line when the hub is lost, or a run is refused.
        give_up_after_s: time without a hub after which ``seen`` raises [s].
        tells_first: say that the hub is there the first time, too.
        tls: files for a ``tls/`` address, to tell why the hub refuses them.
    """

    address: str
    say: Callable[[str], None]
    warn: Callable[[str], None]
    give_up_after_s: float = math.inf
    tells_first: bool = False
    tls: Tls | None = None
    fleet: str = DEFAULT_FLEET
    _lost_s: float | None = None
    _told: str = ""
    _tell_s: float = 0.0
    _hubs: frozenset[str] = frozenset()
    _refusals: set[str] = field(default_factory=set)

    def refused(self, line: str) -> None:
        """Write a line about a refused run, once, and not without end."""
        if line not in self._refusals and len(self._refusals) < _MOST_REFUSALS:
            self._refusals.add(line)
            self.warn(line)

    def met(self, theirs: bytes, own: str) -> None:
        """Tell if a coordinator is of another version than this agent."""
        if theirs not in (b"", own.encode()):
            shown = printable(theirs[:MOST_SHOWN].decode("ascii", "replace"))
            self.refused(f"refused by a coordinator of version {shown}: this is {own}")

    @property
    def is_lost(self) -> bool:
        """Whether the last line was that there is no hub."""
        return self._lost_s is not None

    def seen(self, hubs: Iterable[object]) -> bool:
        """Note the ids of the connected hubs; return whether one is new.

        Raises:
            HubLost: none has been there for too long.
        """
        now_s, there = time.monotonic(), frozenset(map(str, hubs))
        if self._lost_s is None and not there & self._hubs:
            # Also if another hub is there already: it was lost between two looks.
            if self._hubs or not there:
                self._lost_s = now_s
                self._tell_lost()
            elif self.tells_first:
                self.say(f"connected to {self.address}")
        if there:
            if self._lost_s is not None:
                self.say(f"{'re' if self._hubs else ''}connected to {self.address}")
            is_new = self._lost_s is not None or not self._hubs
            self._lost_s, self._hubs, self._told = None, there, ""
            return is_new
        if self.tls and now_s >= self._tell_s:
            self._tell_lost()
        waited_s = now_s - (self._lost_s or now_s)
        if waited_s > 0.0 and waited_s >= self.give_up_after_s:
            raise HubLost(gave_up(self.address, self.give_up_after_s))
        return False

    def _tell_lost(self) -> None:
        """Tell that there is no hub, or why it refuses this process, if that is new."""
        gone = " (it ended, or the network is down)" if self._hubs else ""
        line = why_no_hub(self.address, self.tls, gone)
        if line != self._told:
            self.warn(f"{line}{self._advice}; retrying; press Ctrl-C to stop")
        self._told, self._tell_s = line, time.monotonic() + _TELL_AGAIN_S

    def look(self, session: zenoh.Session, me: FleetMember) -> None:
        """Do ``seen`` for a session; tell if a new hub drops what it sends."""
        if not self.seen(session.info.routers_zid()) or not self._advice:
            return
        allowed = usable([me.trial], session, client_config(self.address, self.tls))
        # Not if the hub has gone meanwhile.
        if allowed == [] and [*session.info.routers_zid()]:
            self.warn(
                f"the hub at {self.address} drops all that this {me.role} sends: its "
                "certificate was revoked, or is not in the access list of the hub as "
                f"that of a {me.role}{self._advice}"
            )

    @property
    def _advice(self) -> str:
        """Which command tells why a hub refuses a certificate; empty without one."""
        if self.tls is None or not self.address.startswith("tls/"):
            return ""
        words = ["revolve", "doctor", "--connect", self.address, "--fleet", self.fleet]
        words += ["--tls-ca", self.tls.ca, "--tls-certificate", self.tls.certificate]
        return f"; {shlex.join([*words, '--tls-key', self.tls.key])} tells more"


def open_at_hub(
    config: zenoh.Config, hub: HubWatch, stop: threading.Event, *, is_agent: bool
) -> zenoh.Session | None:
    """Return a session as soon as there is a hub; None if stopped before.

    Raises:
        HubLost: as of ``HubWatch.seen``.
    """
    while not stop.is_set():
        try:
            return open_session(config, is_agent=is_agent)
        except zenoh.ZError:
            # A process that is told to stop meanwhile needs no hub.
            if not stop.is_set():
                hub.seen(())
        stop.wait(_RETRY_S)
    return None


def usable(
    keys: Collection[str], session: zenoh.Session, config: str, within_s: float = 3.0
) -> list[str] | None:
    """Return which keys of its own a process may use; None without a second connection.

    A hub drops what its rules do not allow, without an answer. A message through the
    hub to this process itself arrives where they allow both ways.
    """
    heard: dict[str, None] = {}
    with ExitStack() as opened, suppress(zenoh.ZError):
        for key in keys:
            hear = partial(heard.setdefault, key)
            opened.enter_context(session.declare_subscriber(key, hear))
        other = opened.enter_context(zenoh.open(zenoh.Config.from_json5(config)))
        until_s = time.monotonic() + within_s
        while time.monotonic() < until_s and len(heard) < len(keys):
            for key in keys:
                other.put(key, b"")
            time.sleep(_BETWEEN_S)
        return list(heard)
    return None


def why_no_hub(connect: str, tls: Tls | None, gone: str = "") -> str:
    """Return that there is no hub, and ``gone``; or why it refuses these files."""
    if tls and connect.startswith("tls/"):
        from schema.agent.certificate import why_refused  # noqa: PLC0415

        if why := why_refused(connect, tls):
            return f"{connect}: {why}"
    return f"no hub at {connect}{gone}"


def gave_up(address: str, after_s: float) -> str:
    """Return the line of a command that ends because no hub answers."""
    return f"no hub at {address} for {after_s:g} s: giving up (--give-up-after)"


class Outlet:
    """Publisher of messages for viewers: best effort, never blocks."""

    def __init__(self) -> None:
        self._session: zenoh.Session | None = None
        self._publishers: dict[str, zenoh.Publisher] = {}

    def lead_to(self, session: zenoh.Session | None) -> None:
        """Publish through a session from now on; None stops publishing."""
        self._session = session
        self._publishers = {}

    def has_listeners(self, key: str) -> bool:
        """Return whether any viewer subscribes to a key."""
        publisher = self._publisher(key)
        # Zenoh's stubs call it a bool; it is an object that is always true.
        status: Any = publisher and publisher.matching_status
        return publisher is not None and bool(status.matching)

    def put(self, key: str, data: bytes) -> None:
        """Publish bytes; they are dropped if the connection is busy."""
        publisher = self._publisher(key)
        if publisher is not None:
            publisher.put(data)

    def _publisher(self, key: str) -> zenoh.Publisher | None:
        """Return the publisher of a key; None while there is no session."""
        if self._session is None:
            return None
        if key not in self._publishers:
            self._publishers[key] = self._session.declare_publisher(
                key,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.DATA_LOW,
            )
        return self._publishers[key]


def serve(
    compute: Compute,
    agent: Agent,
    stop: threading.Event,
    say: Callable[[str], None] = tell_user,
    *,
    warn: Callable[[str], None] = warn_user,
    outlet: Outlet | None = None,
    slot: ProcessSlot = UNSUPERVISED,
) -> None:
    """Do jobs until stopped; wait for the hub as long as needed.

    The current job is finished and the next one dropped: its coordinator gives it to
    another agent.

    Lines are written as ``HubWatch`` does. The outlet publishes through this agent's
    session while there is one.

    Raises:
        NetworkError: an invalid name or address, or ``HubLost``.
    """
    check_name(agent.name, "name")
    check_name(agent.fleet, "fleet")
    me = FleetMember(agent.fleet, agent.role, agent.name)
    config = session_config(client_config(agent.connect, agent.tls), me)
    server = Server(compute, agent, slot)
    hub = HubWatch(
        agent.connect,
        say,
        warn,
        agent.give_up_after_s,
        tells_first=agent.tells_hub,
        # The first process of a pool speaks for all.
        tls=None if slot.index else agent.tls,
        fleet=agent.fleet,
    )
    outlet = outlet or Outlet()
    session = open_at_hub(config, hub, stop, is_agent=True)
    if session is not None:
        with session:
            outlet.lead_to(session)
            _serve_session(session, server, hub, stop, me)
            # First: closing the session can take longer than a pool waits.
            _tell_totals(agent.name, server.counts)
            outlet.lead_to(None)


def own_agent(agent: Agent, index: int) -> Agent:
    """Return the agent of one process of a pool."""
    return replace(
        agent,
        name=unique_name(f"{agent.name}-{index}"),
        platform=platform_tag(),
        version=wire_version(),
        shards=shards_that_fit(memory_bytes(), agent.processes),
    )


def serve_as_process(
    compute: Compute, agent: Agent, slot: ProcessSlot, outlet: Outlet | None = None
) -> None:
    """Serve as one process of a pool until a signal or until the parent is gone."""
    allow(agent.plugins)
    stop = stop_on_signals()
    stop_with_parent(stop.set)
    own = agent if agent.version else own_agent(agent, slot.index)
    start_log(own.name)
    say, warn = (_keep_quiet, _keep_quiet) if slot.index else (tell_user, warn_user)
    try:
        serve(compute, own, stop, say, warn=warn, outlet=outlet, slot=slot)
    except HubLost:
        sys.exit(GAVE_UP)  # the pool's command says why


def _tell_totals(name: str, counts: ReplyCounts) -> None:
    if counts.refused:
        warn_user(
            f"{name} refused {counted(counts.refused, 'request')}, "
            f"{counts.malformed} of them malformed"
        )
    if counts.crowd or counts.cancels:
        tell_user(
            f"{name} dropped {counts.crowd} requests beyond the limit and "
            f"{counts.cancels} malformed cancellations"
        )


def _keep_quiet(_line: str) -> None:
    """Write nothing: the first process of the pool does."""


def _serve_session(
    session: zenoh.Session,
    server: Server,
    hub: HubWatch,
    stop: threading.Event,
    me: FleetMember,
) -> None:
    inbox: Inbox[zenoh.Query] = Inbox()
    take = zenoh.handlers.Callback(inbox.put, indirect=False)
    # Replies under a declared key are shorter and faster to handle at the hub.
    jobs = session.declare_keyexpr(me.jobs)
    waiting = WaitingJobs(jobs, server.counts)

    def reply_info(query: zenoh.Query) -> None:
        with query:
            query.reply(me.info, server.info)
            version = query.payload.to_bytes() if query.payload else b""
            hub.met(version, server.agent.version)

    def cancel(sample: zenoh.Sample) -> None:
        server.cancel(sample.payload.to_bytes())

    def look() -> None:
        while not stop.wait(LOOK_S):
            server.look()
            waiting.send_replies()

    threading.Thread(target=look, daemon=True).start()
    # The token comes last: a coordinator that sees it sends jobs at once.
    with (
        session.declare_queryable(me.jobs, take, complete=True),
        session.declare_queryable(
            me.info, zenoh.handlers.Callback(reply_info), complete=True
        ),
        session.declare_subscriber(
            me.cancelled, zenoh.handlers.Callback(cancel, indirect=False)
        ),
        session.liveliness().declare_token(me.alive),
    ):
        hub.look(session, me)
        while not stop.is_set():
            if not waiting.take_all(inbox):
                if not stop.is_set():
                    hub.look(session, me)
                continue
            if hub.is_lost:
                hub.look(session, me)
            reply = waiting.do_next(server)
            if reply.reason.startswith(UNFIT):
                why = reply.reason.removeprefix(UNFIT)
                hub.refused(f"refused a run, and gets no more jobs of it: {why}")
        waiting.take_all(inbox)
        waiting.drop_all()
