"""Check of a certificate and its key."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

from coordinator.doctor.finding import Finding
from schema.agent.access import Certificate
from schema.agent.certificate import CertificateFacts

_SOON = timedelta(days=14)


def check_certificate(
    facts: CertificateFacts,
    key_mode: int,
    accepted: Sequence[Certificate] | None,
    now: datetime,
) -> list[Finding]:
    """Check a certificate and its key.

    Args:
        facts: of the certificate.
        key_mode: permissions of the key's file.
        accepted: those that the hub accepts; None: not known here.
        now: the time.
    """
    role = next((each.role for each in accepted or () if each.name == facts.name), None)
    days = (facts.ends - now) // timedelta(days=1)
    title = f"{facts.name!r}" + (f", {role}" if role else "")
    text = f"{title}, {days} days left"
    renew = "revolve cluster renew, and copy the folder again"
    if not facts.is_issued:
        why = f"{title} is not of the authority of --tls-ca"
        certificate = Finding("fail", "certificate", why, "copy both of one kit")
    elif not facts.fits_key:
        why = f"{title} does not fit the key of --tls-key"
        certificate = Finding("fail", "certificate", why, "copy both of one kit")
    elif now < facts.begins:
        why = f"{title} is valid from {facts.begins.astimezone(UTC):%Y-%m-%d %H:%M} UTC"
        certificate = Finding("fail", "certificate", why, "set the clock")
    elif now >= facts.ends:
        why = f"{title} has expired on {facts.ends.astimezone(UTC):%Y-%m-%d}"
        certificate = Finding("fail", "certificate", why, renew)
    elif accepted is not None and role is None:
        why = f"{text}, but it is not in --access"
        advice = "it was revoked, or the list is of another kit"
        certificate = Finding("fail", "certificate", why, advice)
    elif facts.ends - now < _SOON:
        certificate = Finding("warn", "certificate", text, renew)
    else:
        certificate = Finding("ok", "certificate", text)
    if key_mode & 0o077:
        why = f"others may read it (mode {key_mode & 0o777:o})"
        return [certificate, Finding("fail", "key", why, "chmod 600 its file")]
    return [certificate, Finding("ok", "key", "only its owner may read it")]
