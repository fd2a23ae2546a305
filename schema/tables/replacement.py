"""Files that are created or replaced as a whole, even across a power loss.

If the disk is full or fails, ``OSError`` is raised and an old file is unchanged.
"""

import contextlib
import errno
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from schema.tables.segments import warn_once

# Of file systems that cannot, such as some of networks and containers.
_CANNOT = (errno.EACCES, errno.EINVAL, errno.ENOSYS, errno.EOPNOTSUPP, errno.EPERM)


def replace_file(path: Path, write: Callable[[Path], object]) -> None:
    """Create or replace a file atomically; its folder must exist."""
    write_new(path, write)
    install_new(path)


def write_new(path: Path, write: Callable[[Path], object]) -> None:
    """Write the new content of a file under another name, for ``install_new``."""
    with _removed_on_error(new_path(path)) as temporary:
        write(temporary)
        sync_file(temporary)


def install_new(path: Path) -> None:
    """Give a file its new content, which ``write_new`` wrote."""
    with _removed_on_error(new_path(path)) as temporary:
        temporary.replace(path)
        sync_folder(path.parent)


def new_path(path: Path) -> Path:
    """Return where the new content of a file is written."""
    return path.with_name(f".{path.name}.new")


def sync_file(file: Path) -> None:
    """Make the content of a file durable, if its file system can."""
    _sync(file, os.O_RDONLY)


def sync_folder(folder: Path) -> None:
    """Make the names in a folder durable, if its file system can."""
    _sync(folder, os.O_RDONLY | os.O_DIRECTORY)


@contextlib.contextmanager
def _removed_on_error(temporary: Path) -> Iterator[Path]:
    try:
        yield temporary
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise


def _sync(path: Path, flags: int) -> None:
    try:
        descriptor = os.open(path, flags | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as error:
        if error.errno not in _CANNOT:
            raise
        warn_once(f"a power loss may damage files: fsync: {error.strerror}")
