"""Program: a worker with correct answers that sends them twice or too late.

Arguments: the address of a hub, and ``twice`` or ``late``. A late worker removes its
liveliness token while it has a job, answers after the coordinator counts it as lost,
and joins again. Ends on SIGTERM and prints its behaviour and the number of answers.
"""

import signal
import sys
import threading
from queue import Empty, SimpleQueue

import zenoh

from schema.agent.network import Agent, client_config
from schema.agent.platform_tag import platform_tag, wire_version
from schema.agent.service import session_config
from schema.agent.supervisor import prepare_process
from schema.agent.topics import Member, unique_name
from schema.wire import revolve_pb2 as pb

GONE_S = 0.3


def main(address: str, behaviour: str) -> None:
    """Serve until SIGTERM."""
    prepare_process()
    from worker.serve.jobs import answer  # noqa: PLC0415 - imports numpy

    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    name = unique_name("odd")
    member = Member("default", "worker", name)
    agent = Agent("worker", name, address, version=wire_version())
    info = pb.AgentInfo(
        agent=agent.name,
        kind=agent.role,
        slots=1,
        platform=platform_tag(),
        version=agent.version,
    ).SerializeToString()
    inbox: SimpleQueue[zenoh.Query] = SimpleQueue()
    count = 0

    def reply_info(query: zenoh.Query) -> None:
        with query:
            query.reply(member.info, info)

    with zenoh.open(session_config(client_config(address), member)) as session:
        on_job = zenoh.handlers.Callback(inbox.put, indirect=False)
        on_info = zenoh.handlers.Callback(reply_info)
        _jobs = session.declare_queryable(member.jobs, on_job, complete=True)
        _info = session.declare_queryable(member.info, on_info, complete=True)
        token = session.liveliness().declare_token(member.alive)
        while not stop.is_set():
            try:
                query = inbox.get(timeout=0.1)
            except Empty:
                continue
            with query:
                assert query.payload is not None
                data = answer(query.payload.to_bytes())
                count += 1
                if behaviour == "late":
                    token.undeclare()  # type: ignore[no-untyped-call]
                    # Meanwhile the job is sent to another worker.
                    stop.wait(GONE_S)
                query.reply(member.jobs, data)
                if behaviour == "twice":
                    query.reply(member.jobs, data)
            if behaviour == "late":
                stop.wait(GONE_S)
                token = session.liveliness().declare_token(member.alive)
    sys.stdout.write(f"{behaviour} {count}\n")


if __name__ == "__main__":
    main(*sys.argv[1:3])
