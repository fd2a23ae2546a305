"""Program: a worker with correct answers that sends them twice or too late.

Arguments: the address of a hub, and ``twice``, ``late`` or ``silent``. A late worker
removes its liveliness token while it has a job, answers after the coordinator counts it
as lost, and joins again. A silent worker makes some advances of an arena and holds the
answer to the next one back until that job is cancelled; then it sends the answer, and
serves as before. Ends on SIGTERM and prints its behaviour and the number of answers; of
a silent worker, the number of those that it held back.
"""

import signal
import sys
import threading
from queue import Empty

import zenoh

from schema.agent.inbox import Inbox
from schema.agent.network import client_config
from schema.agent.request_handler import answer
from schema.agent.service import session_config
from schema.agent.supervisor import prepare_process
from schema.agent.topics import FleetMember, unique_name
from schema.limits import BUNDLE_BYTES
from schema.wire.codec import decode, encode
from schema.wire.messages import Jobs, Reply, Request
from tests.system.fleet import introduce

GONE_S = 0.3
GOOD_ANSWERS = 3
"""Answers of a silent worker before it falls silent."""


def main(address: str, behaviour: str) -> None:
    """Serve until SIGTERM."""
    prepare_process()
    # They import numpy.
    from worker.arena.world import World  # noqa: PLC0415
    from worker.serve.jobs import Jobs as Work  # noqa: PLC0415
    from worker.serve.shards import Shards  # noqa: PLC0415

    compute = Work(Shards(World)).answer
    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    member = FleetMember("default", "worker", unique_name("odd"))
    inbox: Inbox[zenoh.Query] = Inbox()
    count = held_back = 0
    is_cancelled = threading.Event()

    def note_cancelled(_: zenoh.Sample) -> None:
        is_cancelled.set()

    with zenoh.open(session_config(client_config(address), member)) as session:
        on_job = zenoh.handlers.Callback(inbox.put, indirect=False)
        _jobs = session.declare_queryable(member.jobs, on_job, complete=True)
        _info = introduce(session, member)
        _cancelled = session.declare_subscriber(member.cancelled, note_cancelled)
        token = session.liveliness().declare_token(member.alive)
        while not stop.is_set():
            try:
                query = inbox.get(0.1)
            except Empty:
                continue
            with query:
                assert query.payload is not None
                jobs = decode(Jobs, query.payload.to_bytes(), BUNDLE_BYTES)
                requests = (decode(Request, each, BUNDLE_BYTES) for each in jobs)
                done = (answer(compute, each) for each in requests)
                data = encode([Reply(place, each) for place, each in enumerate(done)])
                count += 1
                if behaviour == "late":
                    token.undeclare()  # type: ignore[no-untyped-call]
                    # Meanwhile the job is sent to another worker.
                    stop.wait(GONE_S)
                if behaviour == "silent" and count == GOOD_ANSWERS + 1:
                    while not (is_cancelled.wait(0.1) or stop.is_set()):
                        pass
                    held_back += is_cancelled.is_set()
                query.reply(member.jobs, data)
                if behaviour == "twice":
                    query.reply(member.jobs, data)
            if behaviour == "late":
                stop.wait(GONE_S)
                token = session.liveliness().declare_token(member.alive)
    number = held_back if behaviour == "silent" else count
    sys.stdout.write(f"{behaviour} {number}\n")


if __name__ == "__main__":
    main(*sys.argv[1:3])
