"""All cameras at once: one process per core, their results merged in order of time."""

import multiprocessing
import os
import queue
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.context import SpawnProcess
from multiprocessing.queues import Queue
from pathlib import Path

from bodycam_ros.errors import RecordingError
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.replay.camera_worker import (
    DroppedImages,
    RegisteredImage,
    SkippedImage,
    WorkerFailure,
    WorkerItem,
    run_camera_worker,
)

_QUEUE_LENGTH = 64
"""Results a worker may be ahead of the solver: bounds the memory of a long recording to some megabytes."""

_POLL_S = 1.0
_ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def register_recording(
    recording_path: Path, cameras: Sequence[str], map_path: Path, settings: PipelineSettings, jobs: int
) -> Iterator[RegisteredImage | SkippedImage | DroppedImages]:
    """Register all images of a recording in ``jobs`` processes.

    The results come in an order that depends on the recording alone: always from the worker that is furthest behind
    in the recording's time.

    Raises:
        BodycamError: what went wrong for the user in a worker.
        RecordingError: a worker was killed.
    """
    shares = [tuple(cameras[start::jobs]) for start in range(min(jobs, len(cameras)))]
    with _workers(recording_path, shares, map_path, settings) as workers:
        reached_ns = dict.fromkeys(range(len(workers)), -1)
        while reached_ns:
            behind = min(reached_ns, key=lambda worker: (reached_ns[worker], worker))
            item = _receive(*workers[behind])
            if item is None:
                del reached_ns[behind]
            elif isinstance(item, WorkerFailure):
                raise item.error
            else:
                reached_ns[behind] = item.stamp_ns
                yield item


@contextmanager
def _workers(
    recording_path: Path, shares: Sequence[tuple[str, ...]], map_path: Path, settings: PipelineSettings
) -> Iterator[list[tuple[SpawnProcess, "Queue[WorkerItem]"]]]:
    context = multiprocessing.get_context("spawn")
    workers = []
    # The processes share the cores among themselves; threads inside them would only get in each other's way.
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(_ONE_THREAD)
    try:
        for cameras in shares:
            outbox: Queue[WorkerItem] = context.Queue(_QUEUE_LENGTH)
            process = context.Process(
                target=run_camera_worker, args=(recording_path, cameras, map_path, settings, outbox), daemon=True
            )
            process.start()
            workers.append((process, outbox))
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})
    try:
        yield workers
    except BaseException:
        for process, _ in workers:
            process.terminate()
        raise
    finally:
        for process, _ in workers:
            process.join()


def _receive(process: SpawnProcess, outbox: "Queue[WorkerItem]") -> WorkerItem:
    while True:
        try:
            return outbox.get(timeout=_POLL_S)
        except queue.Empty:
            if not process.is_alive():
                raise RecordingError(
                    f"a tracking process ended with exit code {process.exitcode}; if the machine ran out of memory, "
                    "give fewer processes (--jobs)"
                ) from None
