"""Addresses of hubs: forms, defaults, the private directory, files of run folders."""

import errno
import fcntl
import os
import socket
import tempfile
import time
from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import pytest

from schema.agent.address import (
    hub_of,
    new_socket,
    parse_address,
    read_address,
    runtime_directory,
    user_hub,
)
from schema.agent.command import connect_of
from schema.errors import NetworkError


@pytest.fixture
def tmp_path() -> Iterator[Path]:
    """Return a folder with a short path: that of a socket has 107 bytes at most."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


@pytest.fixture(autouse=True)
def _temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let temporary files lie in a folder that does not exist yet."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "t"))


@pytest.fixture
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path


def test_runtime_directory_is_private(runtime: Path) -> None:
    place = runtime_directory()
    assert place == runtime / "revolve"
    assert place.stat().st_mode & 0o777 == 0o700
    assert runtime_directory() == place


def test_without_runtime_directory_a_private_temporary_one_is_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    (tmp_path / "t").mkdir()
    assert runtime_directory() == tmp_path / "t" / f"revolve-{os.getuid()}"
    assert runtime_directory().stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("name", ["l" * 60 + "o" * 30, "with space", "missing"])
@pytest.mark.parametrize("variable", ["XDG_RUNTIME_DIR", "TMPDIR"])
def test_a_directory_that_sockets_cannot_use_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, variable: str
) -> None:
    bad, good = tmp_path / name, tmp_path / "t"
    good.mkdir()
    if name != "missing":
        bad.mkdir()
    places = {"XDG_RUNTIME_DIR": good, variable: bad}
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(places["XDG_RUNTIME_DIR"]))
    monkeypatch.setattr("tempfile.tempdir", str(places.get("TMPDIR", good)))
    for address in (new_socket(), user_hub()):
        assert parse_address(address).host.startswith(f"{good}/revolve")


def test_a_directory_of_another_user_is_replaced(
    runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another user may create ours among the temporary files, to be in the way."""
    theirs = runtime / "t" / f"revolve-{os.getuid()}"
    theirs.mkdir(parents=True)
    real = os.access
    monkeypatch.setattr(
        "os.access", lambda path, mode: path != theirs and real(path, mode)
    )
    assert parse_address(new_socket()).host.startswith(f"{runtime}/revolve/")


def test_sockets_of_runs_outlive_the_login_of_their_user(runtime: Path) -> None:
    """The system removes ``$XDG_RUNTIME_DIR`` when the user logs out."""
    (runtime / "t").mkdir()
    assert user_hub().startswith(f"unixsock-stream/{runtime}/revolve/")
    assert new_socket().startswith(f"unixsock-stream/{runtime}/t/revolve-")


def test_without_any_file_locks_a_run_listens_on_loopback(
    runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Unix sockets of Zenoh need file locks; a directory that has some is preferred."""
    lacking = {runtime}
    real = fcntl.flock

    def flock(file: IO[bytes], how: int) -> None:
        place = Path(f"/proc/self/fd/{file.fileno()}").resolve()
        if any(each in place.parents for each in lacking):
            raise OSError(errno.ENOSYS, "Function not implemented")
        real(file, how)

    monkeypatch.setattr("fcntl.flock", flock)
    (runtime / "t").mkdir()
    assert new_socket().startswith("unixsock-stream//tmp/revolve-")
    lacking.add(Path("/"))
    protocol, host, port = parse_address(new_socket())
    assert (protocol, host) == ("tcp", "127.0.0.1")
    with socket.create_server((host, port)):
        pass


def test_a_full_disk_does_not_open_a_run_to_other_users(
    runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise a user who fills ``/tmp`` could join the runs of others."""

    def full(**_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("tempfile.TemporaryFile", full)
    assert new_socket().startswith(f"unixsock-stream/{runtime}/revolve/")


@pytest.mark.parametrize("mode", [0o755, 0o770, 0o701, None])
def test_directory_that_others_can_enter_is_refused(
    runtime: Path, mode: int | None
) -> None:
    """So is a link, even to a private one."""
    if mode is None:
        (runtime / "elsewhere").mkdir(mode=0o700)
        (runtime / "revolve").symlink_to(runtime / "elsewhere")
    else:
        (runtime / "revolve").mkdir()
        (runtime / "revolve").chmod(mode)
    for address in (new_socket, user_hub):
        with pytest.raises(NetworkError, match="mode 0700"):
            address()


def test_sockets_differ_and_the_users_hub_does_not(runtime: Path) -> None:
    assert new_socket() != new_socket()
    assert user_hub() == f"unixsock-stream/{runtime}/revolve/hub.sock"
    assert parse_address(user_hub()) == (
        "unixsock-stream", f"{runtime}/revolve/hub.sock", 0,
    )  # fmt: skip


@pytest.mark.usefixtures("runtime")
def test_sockets_of_killed_processes_are_removed() -> None:
    place = runtime_directory()
    earlier_s = time.time() - 10.0
    names = {name: name.ljust(16, "0") for name in ("killed", "alive", "starting")}
    for name in (*names.values(), "hub"):
        (place / f"{name}.sock").touch()
        (place / f"{name}.sock.lock").touch()
        if name != names["starting"]:
            os.utime(place / f"{name}.sock.lock", (earlier_s, earlier_s))
    # Killed before it listened.
    begun = place / f"{'1' * 16}.sock.lock"
    begun.touch()
    os.utime(begun, (earlier_s, earlier_s))
    with (place / f"{names['alive']}.sock.lock").open("rb") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        new_socket()
    left = {path.name.partition(".")[0] for path in place.iterdir()}
    # The next hub of this user listens at the same place.
    assert left == {names["alive"], names["starting"], "hub"}


@pytest.mark.parametrize("path", ["relative.sock", "/" + "x" * 98, "/with space", "/"])
def test_invalid_socket_paths_are_refused(path: str) -> None:
    with pytest.raises(NetworkError):
        parse_address(f"unixsock-stream/{path}")


def test_default_address_comes_from_the_environment(
    runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("REVOLVE_CONNECT", raising=False)
    default = Namespace(connect=None)
    assert connect_of(default) == f"unixsock-stream/{runtime}/revolve/hub.sock"
    monkeypatch.setenv("REVOLVE_CONNECT", "tls/hub.example:7447")
    assert connect_of(default) == "tls/hub.example:7447"


def test_folder_of_a_run_gives_its_hubs_address(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    with pytest.raises(NetworkError, match="no coordinator is running"):
        hub_of(str(folder))
    path = tmp_path / "s"
    (folder / "address").write_text(f"tls/hub:7447\nunixsock-stream/{path}\n")
    assert hub_of(str(folder)) == "tls/hub:7447", "the socket is on another machine"
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(path))
        assert hub_of(str(folder)) == f"unixsock-stream/{path}"
    assert hub_of("tcp/127.0.0.1:7447") == "tcp/127.0.0.1:7447"
    with pytest.raises(NetworkError, match="no such folder: 'runs/three'"):
        hub_of("runs/three")


@pytest.mark.parametrize("content", [b"\xff\xfe", b"tcp/h:1\nrubbish\n", b"x" * 10000])
def test_damaged_address_file_is_named_in_one_line(
    tmp_path: Path, content: bytes
) -> None:
    (tmp_path / "address").write_bytes(content)
    with pytest.raises(NetworkError, match="damaged") as caught:
        read_address(tmp_path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 600


@pytest.mark.parametrize("content", [b"", b"\n", b"unixsock-stream//nowhere/s\n"])
def test_address_file_without_reachable_address_is_refused(
    tmp_path: Path, content: bytes
) -> None:
    (tmp_path / "address").write_bytes(content)
    with pytest.raises(NetworkError, match="no address that this machine can reach"):
        read_address(tmp_path)
