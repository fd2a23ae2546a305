"""Name and expiry of a certificate file.

Importing this module raises ``NetworkError`` where ``cryptography`` is not installed:
import it only where there are certificates.
"""

from datetime import datetime
from pathlib import Path

from schema.errors import NetworkError

try:
    from cryptography import x509
except ImportError:
    raise NetworkError(
        "certificates need the package cryptography: "
        "pip install 'revolve-islands[cluster]'"
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


def expiry(file: str) -> datetime:
    """Return when a certificate expires, in UTC.

    Raises:
        NetworkError: the file holds no certificate.
    """
    return _read(file).not_valid_after_utc


def _read(file: str) -> x509.Certificate:
    try:
        return x509.load_pem_x509_certificate(Path(file).read_bytes())
    except (OSError, ValueError) as error:
        reason = str(error).partition("\n")[0]
        raise NetworkError(f"{file}: not a certificate (PEM): {reason}") from None
