"""Fleets as the Python API has them: workers for a loop of the user's own."""

import atexit
import math
import os
import threading
from argparse import Namespace
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from functools import lru_cache, partial
from itertools import islice
from pathlib import Path
from typing import Any, Self, TypeVar, cast

import msgspec

from coordinator.dispatch.events import Deliver
from coordinator.islands.events import QUARANTINED
from coordinator.network.service import Network
from coordinator.run.requests import Expected, failure_of, read_answer, read_evaluation
from revolve.arguments import in_order, naming_arguments, whole_number
from revolve.children import Workers
from revolve.engine import Engine, WantedJob
from revolve.evaluation import Result, outside_of_runs, result_of, settings_for
from revolve.experiment import Experiment
from revolve.robot import Robot, checked
from schema.agent.command import connect_of, name_at, tls_of
from schema.agent.network import DEFAULT_FLEET, Tls
from schema.agent.supervisor import cores, most_processes
from schema.agent.topics import unique_name
from schema.errors import ExperimentError, JobRefused, RevolveError, shown
from schema.experiment.brains import types_of
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.experiment.settings import EvaluationSettings
from schema.limits import ANSWER_BYTES, VALUE_BYTES
from schema.plugins.load import load_function
from schema.plugins.permission import allow, allow_references, allowed
from schema.plugins.source import forget_digests
from schema.robot.robot import Robot as PlainRobot
from schema.wire.calls import call_settings, pack_value, unpack_value
from schema.wire.messages import Answer, Call, CallValue, Evaluate, Failure

T = TypeVar("T")

_NO_FLAGS = Namespace(tls_ca=None, tls_certificate=None, tls_key=None)
_LEAST_AHEAD = 256
_AHEAD_PER_WORKER = 20


class Fleet:
    """Workers that evaluate robots, here or on other machines; use it in a ``with``.

    It is to robots what ``concurrent.futures.Executor`` is to functions. Jobs are sent,
    repeated and checked as those of runs: a worker that dies or falls silent costs
    time, not results, and a result does not depend on which worker computed it.

        with rv.Fleet(workers=4) as fleet:
            for result in fleet.evaluate(robots, "scenario1"):
                print(result.fitness)

    Threads may share a fleet.
    """

    def __init__(
        self,
        workers: int | None = None,
        *,
        connect: str | None = None,
        fleet: str = DEFAULT_FLEET,
        tls: tuple[str, str, str] | None = None,
        plugins: Iterable[str] = (),
        give_up_after_s: float = math.inf,
    ) -> None:
        """Configure a fleet; ``with`` opens it.

        Args:
            workers: worker processes to start on this machine, at most four per core;
                None: one per core, or none with ``connect``. They start with the first
                job.
            connect: address of a hub whose workers do the jobs, or folder of an active
                run; None: only the workers that this fleet starts.
            fleet: name of the fleet at that hub.
            tls: files of certificate authority, certificate and key, for ``tls/``;
                None: of the variables ``REVOLVE_TLS_CA``, ``_CERTIFICATE``, ``_KEY``.
            plugins: modules or ``.py`` files that may be imported here and by the
                workers that this fleet starts.
            give_up_after_s: time for which jobs wait without a worker that can do them;
                then all fail with ``NetworkError``, which says why [s].

        Raises:
            RevolveError: a number of workers that is no whole number, too small or too
                large.
            ExperimentError: no such module or file.
            NetworkError: an invalid address or name.
        """
        least = 0 if connect else 1
        wanted = least * cores() if workers is None else workers
        self._count = whole_number("workers", wanted, least, most_processes())
        if not give_up_after_s > 0.0:
            raise RevolveError(f"give_up_after_s: must be > 0, got {give_up_after_s}")
        self._give_up_after_s = give_up_after_s
        with naming_arguments():
            allow(plugins)
            address = connect_of(Namespace(connect=connect)) if connect else ""
            named = tls_of(_NO_FLAGS) if address.startswith("tls/") else None
            files = Tls(*tls) if tls else named
            self._network = Network(
                name=unique_name(name_at(address, files, "python")),
                fleet=fleet,
                connect=address,
                tls=files,
            )
        self._engine: Engine | None = None
        self._workers: list[Workers] = []
        self._owner = os.getpid()
        self._lock = threading.Lock()

    def __enter__(self) -> Self:
        """Open the fleet.

        Raises:
            NetworkError: no hub answers.
        """
        # Its workers import the sources as they are now.
        forget_digests()
        self._engine = Engine(self._network, self._fault, self._give_up_after_s)
        atexit.register(self.close)
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Drop all open jobs and end the workers that this fleet started."""
        if self._engine is None or self._owner != os.getpid():
            return
        atexit.unregister(self.close)
        self._engine.refuse()
        with self._lock:
            workers, self._workers = self._workers, []
        for each in workers:
            each.close()
        # The hub last: workers that lose it say so.
        for each in workers:
            each.end()
        self._engine.close()

    @property
    def workers(self) -> int:
        """Number of workers that have joined and can do the jobs.

        Raises:
            RevolveError: the fleet is not open.
        """
        return self._opened.workers

    def submit(
        self,
        robot: Robot | PlainRobot,
        experiment: Experiment | str | Path | None = None,
        *,
        trial: int = 0,
        record: Sequence[str] = (),
        trace: bool = False,
    ) -> "Future[Result]":
        """Start the evaluation of a robot.

        Args:
            robot: to evaluate.
            experiment: as for ``revolve.evaluate``.
            trial: as for ``revolve.evaluate``.
            record: as for ``revolve.evaluate``; the result has its trace, then.
            trace: whether the result has its trace in any case.

        Returns:
            A future of the result; see ``revolve.evaluate``. A robot that ends its
            process three times has a result with that failure. The future raises
            ``RevolveError`` if several workers cannot do such a job, or no worker is
            left.

        Raises:
            InvalidRobot: the robot is not well formed for this experiment.
            ExperimentError: no such experiment or file, or an invalid document; no such
                channel.
            RevolveError: the fleet is closed or not open; another trial.
        """
        identity = outside_of_runs(trial)
        settings = settings_for(robot, experiment, record)
        return self._submit(robot, settings, identity, is_traced=trace)

    def evaluate(
        self,
        robots: Iterable[Robot | PlainRobot],
        experiment: Experiment | str | Path | None = None,
        *,
        trials: Iterable[int] = (0,),
        record: Sequence[str] = (),
        trace: bool = False,
    ) -> Iterator[Result]:
        """Evaluate robots; return their results in the same order.

        Robots are taken from the iterable as workers need them, some hundred ahead. The
        rest is dropped if the iterator is closed. An evaluation takes as long as one of
        ``revolve.evaluate``, also with ``simulation.evaluation_s``.

        Args:
            robots: to evaluate.
            experiment: as for ``revolve.evaluate``.
            trials: numbers of the evaluations of each robot, as ``trial`` of
                ``revolve.evaluate``; the results of one robot follow each other in
                their order.
            record: as for ``submit``.
            trace: as for ``submit``.

        Raises:
            InvalidRobot: as for ``submit``; from the iterator, too.
            ExperimentError: as for ``submit``.
            RevolveError: robots or trials without an order, as a set; no trial; as for
                ``submit`` and its future.
        """
        robots = in_order("robots", robots)
        identities = [outside_of_runs(each) for each in in_order("trials", trials)]
        if not identities:
            raise RevolveError("trials: must be one or more numbers, got none")
        named = None if experiment is None else settings_for(None, experiment, record)
        return self._in_order(
            self._submit(robot, settings, identity, is_traced=trace)
            for robot in robots
            for settings in [named or settings_for(robot, None, record)]
            for identity in identities
        )

    def map(
        self, function: str | Callable[[Any], Any], items: Iterable[object]
    ) -> Iterator[Any]:
        """Call a function with each item; return its values in the same order.

        The function must be pure: a call may be repeated on another worker. Workers
        import it by name. Those of this fleet may import its module from now on; those
        at ``connect`` must have the same source, and their owner must allow it.

            def score(numbers):  # in lab.py
                return sum(numbers)

            list(fleet.map("lab:score", [[1, 2], [3]]))  # [3, 3]

        Args:
            function: of one argument, as ``"module:function"`` or as an object that
                has such a name. A module may be a file in the current folder.
            items: plain: None, bool, int, float, str, bytes, list or dict of such, and
                tuples, which become lists.

        Raises:
            UnknownPlugin: no such function.
            ExperimentError: no function of one argument, or one of ``__main__``; from
                the iterator, an item that is not plain.
            RevolveError: items without an order, as a set; from the iterator, if a
                call fails; as for ``submit``, too.
        """
        items = in_order("items", items)
        path = _path_of(function)
        allow_references([path], Path.cwd())
        load_function(path, "function", 1)
        settings = call_settings(path)
        return self._in_order(
            self._call(settings, item, number) for number, item in enumerate(items)
        )

    def _call(self, settings: bytes, item: object, number: int) -> "Future[Any]":
        try:
            call = Call(pack_value(item))
        except ExperimentError as error:
            raise ExperimentError(f"item {number}: {error}") from None
        settle = partial(_value, number=number)
        return self._order(WantedJob("call", call, settings, _read_value, settle))

    def _submit(
        self,
        robot: Robot | PlainRobot,
        settings: EvaluationSettings,
        identity: Identity = NO_IDENTITY,
        *,
        is_traced: bool = False,
    ) -> "Future[Result]":
        plain = checked(robot, types_of(settings))
        is_traced = bool(is_traced or settings.record)
        work = Evaluate(identity.birth, plain, identity.trial, is_traced=is_traced)
        data, simulated_s = _job_of(settings)
        measures = len(settings.measures.names)
        read = partial(read_evaluation, measures=measures, is_traced=is_traced)
        settle = partial(_settle, settings=settings, robot=plain)
        return self._order(
            WantedJob(
                "evaluate", work, data, read, settle, simulated_s, identity.origin
            )
        )

    def _order(self, order: WantedJob) -> "Future[T]":
        engine = self._opened
        with self._lock:
            engine.check()
            self._start_workers()
        engine.order(order)
        return order.future

    def _in_order(self, futures: Iterator["Future[T]"]) -> Iterator[T]:
        ahead = max(_LEAST_AHEAD, _AHEAD_PER_WORKER * self._count)
        results = _results(deque(islice(futures, ahead)), futures)
        # A generator that has not begun would cancel nothing when it is closed.
        next(results)
        return results

    def _start_workers(self) -> None:
        """Start the workers, or replace them by some that may import more plug-ins."""
        plugins = allowed()
        if not self._count or (self._workers and self._workers[-1].plugins == plugins):
            return
        for earlier in self._workers:
            earlier.close()
        self._workers.append(Workers(self._network.own_address, self._count, plugins))

    def _fault(self) -> str:
        """Return why no worker can do a job any more; empty if there is no reason."""
        if not self._workers:
            return ""
        code = self._workers[-1].exit_code
        return "" if code is None else f"the workers have ended with exit code {code}"

    @property
    def _opened(self) -> Engine:
        if self._engine is None:
            raise RevolveError("the fleet is not open: use it in a 'with'")
        return self._engine


def _results(
    waiting: "deque[Future[T]]", futures: Iterator["Future[T]"]
) -> Iterator[T]:
    """Yield nothing, then the results of futures in order; cancel the rest at last."""
    try:
        yield cast("T", None)
        while waiting:
            yield waiting[0].result()
            waiting.popleft()
            waiting.extend(islice(futures, 1))
    finally:
        for future in waiting:
            future.cancel()


@lru_cache(maxsize=64)
def _job_of(settings: EvaluationSettings) -> tuple[bytes, float]:
    """Return settings as JSON, and the length of an evaluation [s]."""
    clock = settings.simulation
    simulated_s = clock.evaluation_steps * clock.timestep_s
    return msgspec.json.encode(settings), simulated_s


def _settle(end: Deliver, settings: EvaluationSettings, robot: PlainRobot) -> Result:
    if end.is_deadly:
        return Result(failure=f"{QUARANTINED}{end.reason}")
    if end.reason:
        raise refusal(end)
    assert isinstance(end.answer, Answer)
    return result_of(end.answer.result, settings, robot)


def _path_of(function: str | Callable[[Any], Any]) -> str:
    """Return the name by which workers import a function."""
    if isinstance(function, str):
        return function
    given: object = function
    if not callable(given):
        raise ExperimentError(
            f"function: must be a function or 'module:attribute', got {shown(given)}"
        )
    home = str(getattr(function, "__module__", None))
    name = str(getattr(function, "__qualname__", None))
    if home == "__main__" or not name.isidentifier():
        raise ExperimentError(
            f"workers cannot import {name} of {home}: put it into a file of its own, "
            "outside of any other function"
        )
    return f"{home}:{name}"


def _read_value(data: bytes, *, expected: Expected) -> object:
    """Return the value of a call, or its failure."""
    answer = read_answer(data, expected, CallValue, VALUE_BYTES + ANSWER_BYTES)
    result = answer.result
    return unpack_value(result.value) if isinstance(result, CallValue) else result


def _value(end: Deliver, *, number: int) -> object:
    if end.reason:
        raise refusal(end)
    if isinstance(end.answer, Failure):
        raise RevolveError(f"item {number}: {failure_of(end.answer)}")
    return end.answer


def refusal(end: Deliver) -> JobRefused:
    """Return the error of a job that several workers cannot do."""
    return JobRefused(
        f"several workers cannot do a job, the last of them {end.agent}: {end.reason}"
    )
