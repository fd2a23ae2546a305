"""Libraries that only pictures and analysis need: extras of the package."""

from collections.abc import Iterator
from contextlib import contextmanager

from schema.agent.extras import install_advice
from schema.errors import RevolveError


class MissingExtra(RevolveError):  # noqa: N818 - names what is missing
    """A library that only analysis needs is not installed."""


@contextmanager
def extra(what: str, name: str) -> Iterator[None]:
    """Report a library that cannot be imported, with the extra that installs it.

    ``what`` begins the message, such as ``pictures need``.

    Raises:
        MissingExtra: a library is not installed.
    """
    try:
        yield
    except ImportError as error:
        raise MissingExtra(f"{what} {error.name}: {install_advice(name)}") from None
