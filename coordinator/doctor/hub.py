"""Checks of hub, rights and coordinators; each takes what was seen."""

from coordinator.doctor.machine import Finding, judged
from coordinator.network.client_service import ROLES, HubProbe
from schema.limits import printable

_SLOW_S = 0.2
_MOST_OFFSET_S = 5.0
_MOST_NAMES = 5


def no_hub(connect: str, why: str, *, is_wanted: bool) -> Finding:
    """Return the finding about a hub without connection."""
    advice = "start the hub, or check --connect, name service and firewall"
    text = "none is running: revolve run needs none, revolve coordinator starts one"
    return judged("hub", text, (is_wanted, "fail", f"{connect}: {why}", advice))


def refused(error: str) -> Finding:
    """Return the finding about a hub that answers but refuses the connection."""
    advice = (
        "check that the hub is one of Revolve Islands of this version, that both "
        "certificates are of one authority, and that the hub's has this host name"
    )
    return Finding("fail", "hub", printable(error), advice)


def check_hub(probe: HubProbe, connect: str) -> list[Finding]:
    """Check what was seen at a hub that accepted the connection."""
    if probe.round_trip_s is None:
        text = f"{connect} accepts connections and does not reply"
        return [Finding("fail", "hub", text, "restart the hub")]
    text = f"{connect}, round trip {1e3 * probe.round_trip_s:.1f} ms"
    slow = "a slow link: give workers there more jobs ahead by more --processes"
    is_slow = probe.round_trip_s > _SLOW_S
    hub = judged("hub", text, (is_slow, "warn", text, slow))
    return [hub, _rights(probe), _coordinators(probe), *_offset(probe)]


def _rights(probe: HubProbe) -> Finding:
    no_rights = (
        "unless this is a viewer or operator, the certificate was revoked, or it is "
        "not in the access.json that the hub has read when it started"
    )
    return judged(
        "rights",
        "those of viewer",
        (probe.roles is None, "ok", "all: no certificates at this address", ""),
        (
            probe.roles == ROLES,
            "warn",
            "all roles: the hub gives every certificate all rights",
            "start it with --access",
        ),
        (bool(probe.roles), "ok", f"those of {' and '.join(probe.roles or ())}", ""),
        (bool(probe.replies or probe.malformed), "ok", "those of operator", ""),
        (
            not probe.coordinators,
            "warn",
            "none that can be tried while no coordinator is running",
            no_rights,
        ),
    )


def _coordinators(probe: HubProbe) -> Finding:
    others = f"another version or damaged: {', '.join(probe.malformed)}"
    advice = "install one version of Revolve Islands everywhere"
    names = ", ".join(probe.coordinators[:_MOST_NAMES]) or "none is running"
    more = len(probe.coordinators) - _MOST_NAMES
    text = f"{names} and {more} more" if more > 0 else names
    is_malformed = bool(probe.malformed)
    return judged("coordinators", text, (is_malformed, "warn", others, advice))


def _offset(probe: HubProbe) -> list[Finding]:
    if probe.offset_s is None:
        return []
    text = f"{probe.offset_s:+.2f} s against this machine's"
    is_far = abs(probe.offset_s) > _MOST_OFFSET_S
    advice = "set both clocks, for example with NTP: certificates depend on them"
    return [judged("its clock", text, (is_far, "warn", text, advice))]
