"""Checks of hub, rights and coordinators; each takes what was seen."""

from coordinator.doctor.finding import Finding
from coordinator.network.probe_service import ROLES, HubProbe
from schema.limits import printable

_SLOW_S = 0.2
_MOST_OFFSET_S = 5.0
_MOST_NAMES = 5


def no_hub(connect: str, why: str, *, is_wanted: bool) -> Finding:
    """Return the finding about a hub without connection.

    Args:
        connect: its address.
        why: there is no connection.
        is_wanted: the user has named it; else this user needs none.
    """
    if is_wanted:
        advice = "start the hub, or check --connect, name service and firewall"
        return Finding("fail", "hub", f"{connect}: {why}", advice)
    text = "none is running: revolve run needs none, revolve coordinator starts one"
    return Finding("ok", "hub", text)


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
    hub = Finding("warn", "hub", text, slow) if is_slow else Finding("ok", "hub", text)
    return [hub, *_rights(probe), _coordinators(probe), *_offset(probe)]


def _rights(probe: HubProbe) -> list[Finding]:
    if probe.roles is None:
        return [Finding("ok", "rights", "all: no certificates at this address")]
    if probe.roles == ROLES:
        text = "all roles: the hub gives every certificate all rights"
        return [Finding("warn", "rights", text, "start it with --access")]
    if probe.roles:
        return [Finding("ok", "rights", f"those of {' and '.join(probe.roles)}")]
    if probe.replies or probe.malformed:
        return [Finding("ok", "rights", "those of operator")]
    if probe.coordinators:
        return [Finding("ok", "rights", "those of viewer")]
    return [
        Finding(
            "warn",
            "rights",
            "none that can be tried while no coordinator is running",
            "unless this is a viewer or operator, the certificate was revoked, or it "
            "is not in the access.json that the hub has read when it started",
        )
    ]


def _coordinators(probe: HubProbe) -> Finding:
    if probe.malformed:
        names = ", ".join(probe.malformed)
        advice = "install one version of Revolve Islands everywhere"
        return Finding(
            "warn", "coordinators", f"another version or damaged: {names}", advice
        )
    if not probe.coordinators:
        return Finding("ok", "coordinators", "none is running")
    names = ", ".join(probe.coordinators[:_MOST_NAMES])
    more = len(probe.coordinators) - _MOST_NAMES
    return Finding(
        "ok", "coordinators", names + (f" and {more} more" if more > 0 else "")
    )


def _offset(probe: HubProbe) -> list[Finding]:
    if probe.offset_s is None:
        return []
    text = f"{probe.offset_s:+.2f} s against this machine's"
    if abs(probe.offset_s) > _MOST_OFFSET_S:
        advice = "set both clocks, for example with NTP: certificates depend on them"
        return [Finding("warn", "its clock", text, advice)]
    return [Finding("ok", "its clock", text)]
