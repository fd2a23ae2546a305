"""Every error that one part of Revolve reports to another.

Whose fault an error is decides its class, and the class decides what is done.
"""

from difflib import get_close_matches
from typing import Any


class RevolveError(Exception):
    """Base of all errors that a user may see as one line."""


class ExperimentError(RevolveError):
    """The user's document is wrong: says where, what came, what is allowed."""


class UnknownPlugin(ExperimentError):  # noqa: N818 - reads as what it says
    """A ``module:attribute`` or a name that nothing answers to."""


class PluginDiffers(RevolveError):  # noqa: N818 - reads as what it says
    """A machine without a plug-in of the run, or with another of its name."""


class InvalidRobot(RevolveError):  # noqa: N818 - reads as what it says
    """A robot or genome that breaks the rules of its body space."""


class RunFolderError(RevolveError):
    """A run folder that is in use, damaged, missing or already taken."""


class NetworkError(RevolveError):
    """An address that cannot be listened on or reached."""


class MalformedMessage(RevolveError):  # noqa: N818 - reads as what it says
    """Bytes of a peer that do not decode: count them, drop them, go on."""


class UnexpectedEvent(RevolveError):  # noqa: N818 - reads as what it says
    """An event that the machine's state does not allow: our own fault, stop."""


class FitnessUndefined(RevolveError):  # noqa: N818 - reads as what it says
    """The fitness function raised, or gave no finite number: a result, too."""


class JobRefused(RevolveError):  # noqa: N818 - reads as what it says
    """Several agents cannot do a job: the machines' fault, never a result."""


class RunPaused(RevolveError):  # noqa: N818 - reads as what it says
    """A run stops for its user to look at something; ``revolve resume`` goes on."""


class SimulationDiverged(RevolveError):  # noqa: N818 - reads as what it says
    """The physics left the realm of numbers: nobody's fault, a result."""


class StateDiffers(RevolveError):  # noqa: N818 - reads as what it says
    """A rebuilt arena is not what it was: this machine computes otherwise."""


def one_line(error: Exception) -> str:
    """Return what an error says, in a line: an engine takes several."""
    return " ".join(str(error).split())


def nearest(word: Any, words: Any) -> str:  # noqa: ANN401 - any iterable of str
    """Return ``; did you mean 'x'?`` for the nearest word, or nothing."""
    found = get_close_matches(str(word), list(words), n=1, cutoff=0.5)
    return f"; did you mean {found[0]!r}?" if found else ""
