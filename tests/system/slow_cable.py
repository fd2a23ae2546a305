"""A slow and lossy cable between two network namespaces: two TAP devices.

Usage: slow_cable.py SPACE DEVICE SPACE DEVICE DELAY_S LOSS SEED
"""

import contextlib
import ctypes
import fcntl
import heapq
import os
import select
import struct
import sys
import time
from pathlib import Path

import numpy as np

_SET_INTERFACE = 0x400454CA
_NETWORK = 0x40000000
_TAP, _NO_HEADER = 0x0002, 0x1000
_LONGEST = 65536
_MOST_WAITING = 1000
"""Packets that wait in the cable; a full one drops, as a real queue does."""


def tap(space: str, device: str) -> int:
    """Return the descriptor of a new TAP device in a network namespace."""
    with (Path("/var/run/netns") / space).open("rb") as file:
        if ctypes.CDLL(None, use_errno=True).setns(file.fileno(), _NETWORK):
            raise OSError(ctypes.get_errno(), f"cannot enter {space}")
    descriptor = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    request = struct.pack("16sH14s", device.encode(), _TAP | _NO_HEADER, b"")
    fcntl.ioctl(descriptor, _SET_INTERFACE, request)
    return descriptor


def relay(ends: tuple[int, int], delay_s: float, loss: float, seed: int) -> None:
    """Pass packets on, each after a delay, and lose a share of them."""
    rng = np.random.default_rng(seed)
    waiting: list[tuple[float, int, int, bytes]] = []
    count = 0
    while True:
        now_s = time.monotonic()
        while waiting and waiting[0][0] <= now_s:
            _, _, target, packet = heapq.heappop(waiting)
            # A device that is down or full loses the packet.
            with contextlib.suppress(OSError):
                os.write(target, packet)
        timeout_s = waiting[0][0] - now_s if waiting else None
        for source in select.select(ends, [], [], timeout_s)[0]:
            packet = os.read(source, _LONGEST)
            count += 1
            if rng.random() >= loss and len(waiting) < _MOST_WAITING:
                target = ends[1 - ends.index(source)]
                due_s = time.monotonic() + delay_s
                heapq.heappush(waiting, (due_s, count, target, packet))


if __name__ == "__main__":
    one, one_device, other, other_device, delay, lost, start = sys.argv[1:]
    pair = tap(one, one_device), tap(other, other_device)
    sys.stdout.write("connected\n")
    sys.stdout.flush()
    relay(pair, float(delay), float(lost), int(start))
