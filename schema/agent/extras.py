"""Extras of this package: what to do if a library is missing."""

import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from urllib.parse import unquote, urlsplit

import msgspec

from schema.errors import RevolveError

NAME = "revolve-islands"


class _Source(msgspec.Struct):
    """Content of ``direct_url.json``; a package of a registry has no such file.

    Source: Python Packaging User Guide, "Recording the Direct URL Origin".
    """

    url: str
    dir_info: dict[str, bool] | None = None


@contextmanager
def extra(what: str, name: str) -> Iterator[None]:
    """Report a library that cannot be imported, with the extra that installs it.

    ``what`` begins the message, such as ``pictures need``.

    Raises:
        RevolveError: a library is not installed.
    """
    try:
        yield
    except ImportError as error:
        raise RevolveError(f"{what} {error.name}: {install_advice(name)}") from None


def install_advice(extra: str) -> str:
    """Return the command that installs an extra, such as ``view``, here.

    Without an extra it installs the package with what it needs.
    """
    wanted = f"[{extra}]" if extra else ""
    try:
        package = distribution(NAME)
    except PackageNotFoundError:
        return f"pip install {shlex.quote(f'{NAME}{wanted}')}"
    flag, place = _origin(package)
    python = shlex.quote(sys.executable)
    install = f"{python} -m pip install"
    # Environments that uv makes have no pip.
    if (package.read_text("INSTALLER") or "").strip() == "uv":
        install = f"uv pip install --python {python}"
    return f"{install} {flag}{shlex.quote(f'{place}{wanted}')}"


def _origin(package: Distribution) -> tuple[str, str]:
    """Return a flag, and the folder or wheel that a package came from, or its name."""
    try:
        source = msgspec.json.decode(
            package.read_text("direct_url.json") or "", type=_Source
        )
    except msgspec.MsgspecError:
        return "", NAME
    url = urlsplit(source.url)
    path = Path(unquote(url.path))
    if url.scheme != "file" or not path.exists():
        return "", NAME
    is_editable = (source.dir_info or {}).get("editable", False)
    return "-e " if is_editable else "", str(path)
