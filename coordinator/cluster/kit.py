"""Folder of a lab's certificates, with the list of their owners.

``cluster.json`` lists all certificates, ``access.json`` those that the hub accepts.
``members/NAME`` holds what the machine of a member needs.
"""

from collections.abc import Callable
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from typing import Literal

import msgspec

from coordinator.cluster.certificates import issue, make_authority
from coordinator.storage.disk import replace_text
from schema.agent.access import Certificate, CertificateRole, check_certificates
from schema.agent.address import parse_address
from schema.errors import RevolveError

STATE = "cluster.json"
ACCESS = "access.json"
DAYS = 90
PORT = 7447
_PLACE = "$HOME/.config/revolve"
"""Where a member's machine keeps its folder; samples name the same place."""

MemberRole = CertificateRole | Literal["hub"]


class CertificateHolder(msgspec.Struct):
    """A certificate of a lab.

    Attributes:
        role: what its owner may do; "hub" only listens.
        expires: when the newest certificate of this name ends, in UTC.
        is_revoked: the hub does not accept it.
    """

    name: str
    role: MemberRole
    expires: datetime
    is_revoked: bool = False


class ClusterKit(msgspec.Struct, forbid_unknown_fields=True):
    """A lab: where its hub is, and its certificates."""

    hub: str
    port: int
    days: int
    members: list[CertificateHolder] = []

    @property
    def address(self) -> str:
        """Address of the hub for other machines."""
        host = f"[{self.hub}]" if ":" in self.hub else self.hub
        return f"tls/{host}:{self.port}"


Clock = Callable[[], datetime]


class Kit:
    """A kit's folder."""

    def __init__(self, folder: Path, cluster: ClusterKit, clock: Clock) -> None:
        self.folder = folder
        self.cluster = cluster
        self._clock = clock

    @classmethod
    def new(cls, folder: Path, cluster: ClusterKit, clock: Clock) -> "Kit":
        """Create a kit without members but the hub.

        Raises:
            RevolveError: the folder is not empty, or an invalid address.
        """
        parse_address(cluster.address)
        if folder.exists() and any(folder.iterdir()):
            raise RevolveError(f"{folder}: not empty: choose another folder")
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        make_authority(*cls._authority_of(folder), f"authority {cluster.hub}", clock())
        kit = cls(folder, cluster, clock)
        kit.add("hub", "hub")
        return kit

    @classmethod
    def read(cls, folder: Path, clock: Clock) -> "Kit":
        """Open a kit.

        Raises:
            RevolveError: there is none, or its list is damaged.
        """
        file = folder / STATE
        try:
            cluster = msgspec.json.decode(file.read_bytes(), type=ClusterKit)
        except FileNotFoundError:
            raise RevolveError(
                f"{folder}: no kit is there ({STATE} is missing)"
            ) from None
        except (OSError, ValueError, RecursionError) as error:
            raise RevolveError(f"{file}: cannot be read: {error}") from None
        return cls(folder, cluster, clock)

    def member(self, name: str) -> CertificateHolder:
        """Return a member; raise ``RevolveError`` if there is none of this name."""
        for member in self.cluster.members:
            if member.name == name:
                return member
        names = ", ".join(member.name for member in self.cluster.members)
        raise RevolveError(
            f"{self.folder}: no certificate {name!r}; there are: {names}"
        )

    def add(self, name: str, role: MemberRole) -> None:
        """Issue a certificate for a new member.

        Raises:
            RevolveError: the name is used, or was revoked and its certificate has not
                expired yet; or its keys would overlap with another's.
        """
        now = self._clock()
        for known in self.cluster.members:
            if known.name == name and known.is_revoked and known.expires > now:
                raise RevolveError(
                    f"{name!r} is revoked, and its certificate would be accepted again "
                    f"until {known.expires:%Y-%m-%d}: choose another name"
                )
        others = [
            known
            for known in self.cluster.members
            if not (known.name == name and known.is_revoked)
        ]
        listed = [*others, CertificateHolder(name, role, now)]
        # The names of revoked certificates count, too.
        check_certificates(Certificate(each.name, "worker") for each in listed)
        self.cluster.members = listed
        self.renew(name)

    def renew(self, name: str) -> None:
        """Issue another certificate for a member; its last one stays valid.

        Raises:
            RevolveError: there is no such member, it is revoked, or the authority has
                expired.
        """
        member = self.member(name)
        if member.is_revoked:
            raise RevolveError(f"{name!r} is revoked: add another name")
        now, days = self._clock(), self.cluster.days
        folder = self.folder / "members" / name
        own = (folder / "certificate.pem", folder / "key.pem")
        hosts = {self.cluster.hub, "localhost"} if member.role == "hub" else set[str]()
        authority = self._authority_of(self.folder)
        member.expires = issue(
            authority, own, name, hosts=sorted(hosts), now=now, days=days
        )
        replace_text(folder / "ca.pem", authority[0].read_text("ascii"))
        replace_text(folder / "env", self._environment(member))
        self._write()

    def revoke(self, name: str) -> None:
        """Remove a member from those that the hub accepts.

        Raises:
            RevolveError: there is no such member, or it is the hub.
        """
        member = self.member(name)
        if member.role == "hub":
            raise RevolveError("the hub cannot be revoked: make a new kit")
        member.is_revoked = True
        self._write()

    def write_samples(self, program: str) -> None:
        """Write the samples for systemd, SLURM, Compose and Apptainer."""
        cluster = self.cluster
        target = self.folder / "samples"
        target.mkdir(exist_ok=True)
        for sample in files("coordinator.cluster").joinpath("samples").iterdir():
            text = sample.read_text("utf-8")
            for word, value in (
                ("@ADDRESS@", cluster.address),
                ("@PORT@", str(cluster.port)),
                ("@REVOLVE@", program),
            ):
                text = text.replace(word, value)
            replace_text(target / sample.name, text)

    def _environment(self, member: CertificateHolder) -> str:
        """Return shell commands that set a member's variables."""
        lines = [
            f"# Copy this folder to {_PLACE} on the machine of {member.name!r}, then:",
            f'#   . "{_PLACE}/env"',
            f'export REVOLVE_TLS_CA="{_PLACE}/ca.pem"',
            f'export REVOLVE_TLS_CERTIFICATE="{_PLACE}/certificate.pem"',
            f'export REVOLVE_TLS_KEY="{_PLACE}/key.pem"',
        ]
        if member.role != "hub":
            lines.append(f"export REVOLVE_CONNECT={self.cluster.address}")
        return "\n".join((*lines, ""))

    def _write(self) -> None:
        access = [
            Certificate(member.name, member.role)
            for member in self.cluster.members
            if member.role != "hub" and not member.is_revoked
        ]
        for name, value in ((STATE, self.cluster), (ACCESS, access)):
            text = msgspec.json.format(msgspec.json.encode(value), indent=1).decode()
            replace_text(self.folder / name, f"{text}\n")
        hub = self.folder / "members" / "hub"
        replace_text(hub / ACCESS, (self.folder / ACCESS).read_text("utf-8"))

    @staticmethod
    def _authority_of(folder: Path) -> tuple[Path, Path]:
        return folder / "ca.pem", folder / "ca.key"


def utc_now() -> datetime:
    """Return the time in UTC, without fractions of a second."""
    return datetime.now(UTC).replace(microsecond=0)
