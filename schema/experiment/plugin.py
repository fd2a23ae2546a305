"""Loading of plug-ins by name: ``"package.module:attribute"``.

There is no registry; the process that runs the code resolves the name.
"""

from difflib import get_close_matches
from functools import lru_cache
from importlib import import_module

from schema.errors import ExperimentError, UnknownPlugin


@lru_cache(maxsize=256)
def load(path: str, where: str) -> object:
    """Return the object that a dotted path names.

    Args:
        path: ``package.module:attribute``.
        where: the key that holds it, for messages.

    Raises:
        UnknownPlugin: not of that form, no such module, no such attribute (the
            nearest is named).
        ExperimentError: importing the module raises another error.
    """
    module_name, colon, attribute = path.partition(":")
    words = [*module_name.split("."), attribute]
    if not (colon and all(word.isidentifier() for word in words)):
        raise UnknownPlugin(f"{where}: must be 'module:attribute', got {path!r}")
    try:
        module = import_module(module_name)
    except ImportError as error:
        raise UnknownPlugin(f"{where}: {path!r}: {error}") from None
    except Exception as error:
        story = f"{type(error).__name__}: {error}"
        raise ExperimentError(f"{where}: {path!r}: {story}") from error
    if not hasattr(module, attribute):
        names = [name for name in vars(module) if not name.startswith("_")]
        near = get_close_matches(attribute, names, n=1)
        hint = f"; did you mean '{module_name}:{near[0]}'?" if near else ""
        raise UnknownPlugin(f"{where}: {module_name} has no {attribute!r}{hint}")
    return getattr(module, attribute)
