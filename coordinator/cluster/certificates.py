"""Certificates of a lab, issued by an authority of its own.

Keys are of the curve P-256. A certificate serves both sides of a connection: its owner
may be the hub or a client.
"""

import os
from collections.abc import Iterable
from datetime import datetime, timedelta
from ipaddress import ip_address
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID as Usage
from cryptography.x509.oid import NameOID

from schema.errors import RevolveError

AUTHORITY_DAYS = 3650
"""How long an authority is valid [d]."""
_EARLIER = timedelta(hours=1)
"""A new certificate is valid for clocks that are this much behind."""


def make_authority(certificate: Path, key: Path, name: str, now: datetime) -> None:
    """Write a new authority's certificate and private key (PEM, PKCS#8, mode 0600)."""
    own = ec.generate_private_key(ec.SECP256R1())
    end = now + timedelta(days=AUTHORITY_DAYS)
    builder = _builder(name, name, own.public_key(), now, end)
    constraints = x509.BasicConstraints(ca=True, path_length=0)
    builder = builder.add_extension(constraints, critical=True)
    _write(certificate, key, builder.sign(own, hashes.SHA256()), own)


def issue(
    authority: tuple[Path, Path],
    files: tuple[Path, Path],
    name: str,
    *,
    hosts: Iterable[str],
    now: datetime,
    days: int,
) -> datetime:
    """Write a certificate that the authority signs, and its private key (mode 0600).

    Authority and files are each a certificate and its key. The owner is reached by the
    hosts, if it is a hub. The certificate ends after the days [d], or with the
    authority. ``now`` is in UTC.

    Raises:
        RevolveError: the authority's files cannot be read, or it has expired.
    """
    try:
        signer = x509.load_pem_x509_certificate(authority[0].read_bytes())
        signer_key = serialization.load_pem_private_key(authority[1].read_bytes(), None)
    except (OSError, ValueError, TypeError) as error:
        raise RevolveError(f"{authority[0].parent}: authority: {error}") from None
    if not isinstance(signer_key, ec.EllipticCurvePrivateKey):
        raise RevolveError(f"{authority[1]}: must be a key of an elliptic curve")
    end = min(now + timedelta(days=days), signer.not_valid_after_utc)
    if end <= now:
        raise RevolveError(
            f"{authority[0].parent}: authority: has expired: make a new kit"
        )
    own = ec.generate_private_key(ec.SECP256R1())
    issuer = str(signer.subject.get_attributes_for_oid(NameOID.COMMON_NAME)[0].value)
    builder = _builder(name, issuer, own.public_key(), now, end)
    constraints = x509.BasicConstraints(ca=False, path_length=None)
    builder = builder.add_extension(constraints, critical=True)
    if names := [_alternative(host) for host in hosts]:
        alternatives = x509.SubjectAlternativeName(names)
        builder = builder.add_extension(alternatives, critical=False)
    usages = x509.ExtendedKeyUsage([Usage.CLIENT_AUTH, Usage.SERVER_AUTH])
    builder = builder.add_extension(usages, critical=False)
    _write(*files, builder.sign(signer_key, hashes.SHA256()), own)
    return end


def _builder(
    name: str, issuer: str, key: ec.EllipticCurvePublicKey, now: datetime, end: datetime
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(_name(name))
        .issuer_name(_name(issuer))
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - _EARLIER)
        .not_valid_after(end)
    )


def _name(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _alternative(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ip_address(host))
    except ValueError:
        return x509.DNSName(host)


def _write(
    certificate_file: Path,
    key_file: Path,
    certificate: x509.Certificate,
    key: ec.EllipticCurvePrivateKey,
) -> None:
    certificate_file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    data = key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
    new = key_file.with_name(f".{key_file.name}.new")
    new.unlink(missing_ok=True)
    descriptor = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(data)
    certificate_file.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
    new.replace(key_file)
