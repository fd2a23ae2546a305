"""Name and validity of a certificate file.

Importing this module raises ``NetworkError`` where ``cryptography`` is not installed:
import it only where there are certificates.
"""

import socket
import ssl
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from schema.agent.address import parse_address
from schema.agent.extras import install_advice
from schema.agent.network import Tls
from schema.errors import NetworkError

try:
    from cryptography import x509
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.serialization import load_pem_private_key
except ImportError:
    raise NetworkError(
        f"certificates need the package cryptography: {install_advice('cluster')}"
    ) from None


def certificate_name(file: str) -> str:
    """Return the common name of a certificate: its owner's name in the fleet.

    Raises:
        NetworkError: the file holds no certificate with a common name.
    """
    names = _read(file).subject.get_attributes_for_oid(x509.NameOID.COMMON_NAME)
    if not names:
        raise NetworkError(f"{file}: the certificate has no common name")
    return str(names[0].value)


@dataclass(frozen=True, slots=True)
class CertificateFacts:
    """What is known of a certificate."""

    name: str
    begins: datetime
    ends: datetime
    is_issued: bool
    fits_key: bool


def examine(tls: Tls) -> CertificateFacts:
    """Return what is known of a process's certificate.

    Raises:
        NetworkError: a file cannot be read, or holds something else.
    """
    own, authority = _read(tls.certificate), _read(tls.ca)
    try:
        own.verify_directly_issued_by(authority)
        is_issued = True
    except (InvalidSignature, ValueError, TypeError):
        is_issued = False
    try:
        key = load_pem_private_key(Path(tls.key).read_bytes(), password=None)
    except (OSError, ValueError, TypeError) as error:
        reason = str(error).partition("\n")[0]
        raise NetworkError(f"{tls.key}: not a private key (PEM): {reason}") from None
    return CertificateFacts(
        certificate_name(tls.certificate),
        own.not_valid_before_utc,
        own.not_valid_after_utc,
        is_issued,
        key.public_key() == own.public_key(),
    )


def why_refused(connect: str, tls: Tls) -> str:
    """Return why a hub with TLS refuses a connection; empty if it does not answer."""
    _, host, port = parse_address(connect)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    try:
        context.load_verify_locations(tls.ca)
        context.load_cert_chain(tls.certificate, tls.key)
        plain = socket.create_connection((host, port), 0.5)
        with context.wrap_socket(plain, server_hostname=host) as link:
            link.recv(1)  # a refusal comes after the handshake
    except ssl.SSLCertVerificationError as error:
        return f"the hub's certificate is not accepted: {error.verify_message}"
    except ssl.SSLError as error:
        reason = str(error.reason or error).replace("_", " ").lower()
        name = certificate_name(tls.certificate)
        return f"no TLS connection with certificate {name!r}: {reason}"
    except OSError:
        pass  # it is gone, or waits for the first message
    return ""


def _read(file: str) -> x509.Certificate:
    try:
        return x509.load_pem_x509_certificate(Path(file).read_bytes())
    except (OSError, ValueError) as error:
        reason = str(error).partition("\n")[0]
        raise NetworkError(f"{file}: not a certificate (PEM): {reason}") from None
