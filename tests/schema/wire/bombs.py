"""Program: decode a message of many megabytes; print what that takes.

Prints JSON: bytes of the message, growth of the peak memory [bytes], CPU time [s], and
the error, empty if the message is decoded. Names of messages are in ``BOMBS``.
"""

import json
import re
import sys
import time
from pathlib import Path
from typing import Any

from schema.errors import MalformedMessage
from schema.limits import ADVANCE_REQUEST_BYTES, MOST_LIVING, MOST_MEASURES
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.wire.arena import Advance, AdvanceShard, Changes, PastAdvance, Rebuild
from schema.wire.codec import decode, encode
from schema.wire.messages import Answer, Call, Evaluate, Request, Work
from schema.wire.updates import Update

Bomb = tuple[object, bytes, bytes]
"""A message, some of its bytes, and an item of the long list in their place."""

_BIRTH = BirthId(0, 0)
_ROBOT = Robot((Part("Core", -1, -1, -1, 0, (1.25,)),))
_PAST = PastAdvance(Changes(), 0, bytes(32))


def _request(work: Work) -> Request:
    return Request("run", 1, 1, work, b"{}")


def _advance(*removals: BirthId, history: tuple[PastAdvance, ...] = ()) -> Request:
    rebuild = Rebuild(b"", history)
    return _request(AdvanceShard(0, 0, 0, Changes(removals), False, rebuild=rebuild))


def _answer() -> tuple[Answer, bytes]:
    advance = Advance(0, bytes(32), (), (), ())
    return Answer(1, 1, 0.0, advance), encode("judgements") + b"\x90"


def _judgement(measures: int) -> bytes:
    return encode([[0, 0], 0, 0, 0, 0, False, [0, 0, 0], [0] * measures])


def _history(removals: int) -> bytes:
    changes = {"removals": [(0, 0)] * removals}
    return encode({"changes": changes, "until": 0, "digest": bytes(32)})


_MANY = _advance(history=(_PAST,)), encode((_PAST,))
_CALL = _request(Call(encode([1.25])))
_EVALUATION = _request(Evaluate(_BIRTH, _ROBOT))
REFUSED: dict[str, Bomb] = {
    "removals": (_advance(_BIRTH), encode([_BIRTH]), encode(_BIRTH)),
    "lists for removals": (_advance(_BIRTH), encode([_BIRTH]), b"\x90"),
    "lists for a history": (*_MANY, b"\x90"),
    "lists for an argument": (_CALL, encode(encode([1.25])), b"\x90"),
    "judgements": (*_answer(), _judgement(0)),
    "parts": (_EVALUATION, encode(_ROBOT.parts), encode(_ROBOT.parts[0])),
    "lists for births": (
        Update("run", 1, 1, True, "x"),
        encode("births") + b"\x90",
        b"\x90",
    ),
}
"""Longer lists than any message has, or lists of other things."""
DECODED: dict[str, Bomb] = {
    "history of removals": (*_MANY, _history(MOST_LIVING)),
    "long history": (*_MANY, _history(0)),
    "parameters": (_EVALUATION, encode((1.25,)), b"\0"),
    "measures": (*_answer(), _judgement(MOST_MEASURES)),
}
"""What the types allow."""
BOMBS = {**REFUSED, **DECODED}


def bytes_of(bomb: Bomb, size: int) -> bytes:
    """Return a message with a list of about ``size`` bytes."""
    message, place, item = bomb
    begin, middle, end = encode(message).partition(place)
    assert middle
    # The name of the list's field stays.
    name = place[:-1] if place.endswith(b"\x90") else b""
    count = size // len(item)
    return begin + name + b"\xdd" + count.to_bytes(4, "big") + item * count + end


def _peak() -> int:
    """Return the peak memory since the last call [bytes]."""
    own = Path("/proc/self")
    (kib,) = re.findall(r"VmHWM:\s+(\d+)", (own / "status").read_text("utf-8"))
    (own / "clear_refs").write_text("5")
    return int(kib) * 1024


def main(name: str, size: int) -> dict[str, Any]:
    """Decode one message; return what that takes."""
    data, error = bytes_of(BOMBS[name], size), ""
    _peak()
    before, start_s = _peak(), time.process_time()
    try:
        decode(type(BOMBS[name][0]), data, ADVANCE_REQUEST_BYTES)
    except MalformedMessage as refused:
        error = str(refused)
    used_s = time.process_time() - start_s
    grown = _peak() - before
    return {"bytes": len(data), "grown": grown, "used_s": used_s, "error": error}


if __name__ == "__main__":
    json.dump(main(sys.argv[1], int(sys.argv[2])), sys.stdout)
