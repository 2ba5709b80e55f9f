"""Where steps are done: in worker processes here, or as Ray tasks on as many machines as there are.

Both give the same results in any order, and a step whose worker dies is done again.
"""

# Ray is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Protocol, runtime_checkable

from peaking.errors import BackendUnavailable, PeakingError
from peaking.experiments.plan import EvaluationStep
from peaking.experiments.steps import Found, perform

Perform = Callable[[EvaluationStep], Found]
"""Does a step; workers have to find it by its name."""

RETRIES = 2
"""How often a step is begun again after its worker died."""


@runtime_checkable
class Executor(Protocol):
    """Does steps, and hands over each result as soon as it is there."""

    def run(self, steps: Sequence[EvaluationStep]) -> Iterator[tuple[EvaluationStep, Found]]:
        """Do all steps, in any order."""
        ...


class InProcess:
    """One step after another, here."""

    def __init__(self, *, perform: Perform = perform) -> None:
        """Do steps by this function."""
        self._perform = perform

    def run(self, steps: Sequence[EvaluationStep]) -> Iterator[tuple[EvaluationStep, Found]]:
        """Do all steps in their order."""
        for step in steps:
            yield step, self._perform(step)


class ProcessPool:
    """Worker processes of one thread each."""

    def __init__(self, workers: int | None = None, *, perform: Perform = perform) -> None:
        """Use so many workers, one per core when not given, and do steps by this function."""
        self._perform = perform
        self._workers = workers or os.cpu_count() or 1

    def run(self, steps: Sequence[EvaluationStep]) -> Iterator[tuple[EvaluationStep, Found]]:
        """Do all steps; neighbours in the list go to workers that know the scene already.

        Raises:
            PeakingError: Workers died again and again: too little memory, as a rule.
        """
        left = list(steps)
        for attempt in range(RETRIES + 1):
            if not left:
                return
            done: set[int] = set()
            try:
                for k, found in self._once(left):
                    done.add(k)
                    yield left[k], found
            except BrokenProcessPool as error:
                if attempt == RETRIES:
                    raise PeakingError(
                        "a worker died three times, most likely for want of memory; use fewer "
                        "(--workers 1); what was done is kept, and is not done again"
                    ) from error
            left = [step for k, step in enumerate(left) if k not in done]

    def _once(self, steps: Sequence[EvaluationStep]) -> Iterator[tuple[int, Found]]:
        context = multiprocessing.get_context("spawn")
        count = min(self._workers, len(steps))
        pool = ProcessPoolExecutor(count, mp_context=context, initializer=_begin_pool_worker)
        waiting: dict[Future[Found], int] = {}
        try:
            queue = iter(enumerate(steps))
            # Few at a time, so that Ctrl-C has little to wait for.
            for k, step in queue:
                waiting[pool.submit(self._perform, step)] = k
                if len(waiting) < 2 * count:
                    continue
                yield from self._finished(waiting)
            while waiting:
                yield from self._finished(waiting)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)

    def _finished(self, waiting: dict[Future[Found], int]) -> Iterator[tuple[int, Found]]:
        done, _ = wait(waiting, return_when=FIRST_COMPLETED)
        for future in done:
            k = waiting.pop(future)
            yield k, future.result()


class RayTasks:
    """Ray tasks (extra `[ray]`), on this machine or a cluster that sees the same folders."""

    def __init__(self, address: str | None = None, *, perform: Perform = perform) -> None:
        """Join the cluster at an address, or start one here, and do steps by this function.

        Raises:
            BackendUnavailable: Ray is not installed.
        """
        try:
            import ray  # pyright: ignore[reportMissingImports]
        except ImportError as error:
            raise BackendUnavailable("--ray needs Ray: pip install 'peaking[ray]'") from error
        self._ray: Any = ray
        self._perform = perform
        if not ray.is_initialized():
            ray.init(address=address, include_dashboard=False, log_to_driver=False)

    def run(self, steps: Sequence[EvaluationStep]) -> Iterator[tuple[EvaluationStep, Found]]:
        """Do all steps; Ray begins those of a worker that died anew."""
        task = self._ray.remote(num_cpus=1, max_retries=RETRIES)(_perform_alone)
        waiting = {task.remote(self._perform, step): step for step in steps}
        while waiting:
            done, _ = self._ray.wait(list(waiting), num_returns=1)
            for reference in done:
                step = waiting.pop(reference)
                try:
                    found: Found = self._ray.get(reference)
                except self._ray.exceptions.RayTaskError as error:
                    raise error.cause from error
                yield step, found


def _perform_alone(perform: Perform, step: EvaluationStep) -> Found:
    _begin_worker()
    return perform(step)


def _begin_pool_worker() -> None:
    end_with_parent()
    _begin_worker()


def end_with_parent() -> None:
    """Let this worker process end as soon as the one that started it is gone, killed or not."""
    parent = multiprocessing.parent_process()
    if parent is None:
        raise RuntimeError("need a process that multiprocessing started")

    def wait_and_end() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait_and_end, daemon=True, name="end-with-parent").start()


def _begin_worker() -> None:
    """Use one thread: there is a worker for every core."""
    os.environ["OMP_NUM_THREADS"] = "1"  # torch reads it when it is imported
    os.environ["OMP_WAIT_POLICY"] = "PASSIVE"

    import cv2
    import numba

    numba.set_num_threads(1)
    cv2.setNumThreads(1)
