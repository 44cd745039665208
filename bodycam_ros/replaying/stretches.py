"""A recording solved in stretches, each in a process of its own, on this computer."""

import logging
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerProcess

import cv2

from bodycam_ros.errors import BodycamError, RecordingError
from bodycam_ros.files.bounded_inputs import bound_inputs
from bodycam_ros.files.whole_file import scratch_folder
from bodycam_ros.replaying.camera_worker import end_with_parent
from bodycam_ros.replaying.first_pass import BLOCK_S
from bodycam_ros.replaying.make_first_pass import make_first_pass
from bodycam_ros.replaying.merge import merge_stretches
from bodycam_ros.replaying.replay import replay
from bodycam_ros.replaying.replay_request import ReplayRequest
from bodycam_ros.replaying.replay_summary import ReplaySummary
from bodycam_ros.replaying.worker_process import ready_to_start, refusal_named, warm_up

_SHOWN = 0.05  # share of a stretch between two reports of its process


def replay_in_stretches(
    request: ReplayRequest,
    stretches: int,
    block_s: float = BLOCK_S,
    on_step: Callable[[str, float], None] = lambda step, share: None,
) -> ReplaySummary:
    """Solve a recording in stretches, ``request.jobs`` at a time: first pass, stretches, merge.

    Args:
        request: files and settings.
        stretches: how many; fewer where they would be shorter than ``block_s``.
        block_s: time between two places at which cameras are tracked anew [s].
        on_step: called with the step, and the share of it that is done.

    Raises:
        BodycamError: as ``replay``, and what went wrong in a stretch.
    """
    warm_up()
    started = time.monotonic()
    first = make_first_pass(request, stretches, block_s, on_step)
    request.output.parent.mkdir(parents=True, exist_ok=True)
    with scratch_folder(request.output.parent) as scratch:
        requests = [
            replace(request, first=first, stretch=number, output=scratch / f"stretch_{number}", force=False)
            for number in range(first.count)
        ]
        _solve_all(requests, request.jobs, lambda share: on_step(f"{first.count} stretches", share))
        summary = merge_stretches(request, first, [each.output for each in requests])
    summary.elapsed_s = time.monotonic() - started
    return summary


@dataclass(frozen=True)
class _Running:
    """A process that solves a stretch, and where it says how far it is, or what went wrong."""

    number: int
    process: ForkServerProcess
    told: "Connection[object, object]"


def _solve_all(requests: list[ReplayRequest], jobs: int, on_share: Callable[[float], None]) -> None:
    """Solve stretches, some at a time."""
    shares = [0.0] * len(requests)
    waiting = deque(enumerate(requests))
    with _killed_at_the_end() as running:
        while waiting or running:
            while waiting and len(running) < jobs:
                running.append(_started(*waiting.popleft()))
            for told in wait([each.told for each in running]):
                each = next(each for each in running if each.told is told)
                share = _received(each)
                shares[each.number] = share
                if share >= 1.0:
                    each.process.join()
                    running.remove(each)
                on_share(sum(shares) / len(shares))


@contextmanager
def _killed_at_the_end() -> Iterator[list[_Running]]:
    running: list[_Running] = []
    try:
        yield running
    finally:
        for each in running:
            each.process.kill()
            each.process.join()


def _started(number: int, request: ReplayRequest) -> _Running:
    with refusal_named(), ready_to_start() as context:
        told, tells = context.Pipe(duplex=False)
        process = context.Process(target=_run_stretch, args=(request, tells), daemon=True)
        process.start()
        tells.close()
    return _Running(number, process, told)


def _received(running: _Running) -> float:
    """Share of a stretch that is done.

    Raises:
        BodycamError: what ended it.
    """
    try:
        message = running.told.recv()
    except EOFError:
        running.process.join()
        raise RecordingError(
            f"the process of stretch {running.number + 1} ended with exit code {running.process.exitcode}; if memory "
            "ran out, give fewer processes (--jobs)"
        ) from None
    if isinstance(message, BodycamError):
        raise message
    assert isinstance(message, float)
    return message


def _run_stretch(request: ReplayRequest, tells: "Connection[object, object]") -> None:
    """Entry of the process: solve one stretch."""
    end_with_parent()
    bound_inputs()
    # Warnings on images are in the record of the stretch, and those on inputs were given by the first pass.
    logging.getLogger("bodycam_ros").setLevel(logging.ERROR)
    cv2.setNumThreads(1)
    latest = 0.0

    def show(step: str, share: float) -> None:
        nonlocal latest
        if share > latest + _SHOWN:
            latest = share
            tells.send(min(share, 0.99))

    try:
        replay(request, show)
        tells.send(1.0)
    except BodycamError as error:
        tells.send(error)
    except MemoryError:
        tells.send(RecordingError("there is not enough memory; give fewer processes (--jobs)"))
