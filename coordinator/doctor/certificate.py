"""Check of a certificate and its key."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

from coordinator.doctor.machine import Finding, Level
from schema.agent.access import Certificate
from schema.agent.certificate import CertificateFacts

_SOON = timedelta(days=14)
_RENEW = "revolve cluster renew, and copy the folder again"


def check_certificate(
    facts: CertificateFacts,
    key_mode: int,
    accepted: Sequence[Certificate] | None,
    now: datetime,
) -> list[Finding]:
    """Check them; ``accepted`` is None where the hub's list is not known."""
    role = next((each.role for each in accepted or () if each.name == facts.name), None)
    days = (facts.ends - now) // timedelta(days=1)
    title = f"{facts.name!r}" + (f", {role}" if role else "")
    level: Level = "fail"
    text, advice = f"{title}, {days} days left", "copy both of one kit"
    if not facts.is_issued:
        text = f"{title} is not of the authority of --tls-ca"
    elif not facts.fits_key:
        text = f"{title} does not fit the key of --tls-key"
    elif now < facts.begins:
        begins = f"{facts.begins.astimezone(UTC):%Y-%m-%d %H:%M} UTC"
        text, advice = f"{title} is valid from {begins}", "set the clock"
    elif now >= facts.ends:
        text = f"{title} has expired on {facts.ends.astimezone(UTC):%Y-%m-%d}"
        advice = _RENEW
    elif accepted is not None and role is None:
        text += ", but it is not in --access"
        advice = "it was revoked, or the list is of another kit"
    else:
        is_soon = facts.ends - now < _SOON
        level, advice = ("warn", _RENEW) if is_soon else ("ok", "")
    certificate = Finding(level, "certificate", text, advice)
    if key_mode & 0o077:
        why = f"others may read it (mode {key_mode & 0o777:o})"
        return [certificate, Finding("fail", "key", why, "chmod 600 its file")]
    return [certificate, Finding("ok", "key", "only its owner may read it")]
