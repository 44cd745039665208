"""The same work for all cameras, as many at once as there are cores."""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from threading import Event
from typing import TypeVar

T = TypeVar("T")


def for_each_camera(
    cameras: Iterable[str], work: Callable[[str, Event], T], on_done: Callable[[int, int], None]
) -> dict[str, T]:
    """Camera -> what the work for it came to.

    Args:
        cameras: names.
        work: done in threads; it should look at the event now and then, and end once it is set: Ctrl-C must not wait
            for two hours of video.
        on_done: told how many are done, and of how many, from the calling thread.
    """
    ended = Event()
    results: dict[str, T] = {}
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        waiting = {camera: pool.submit(work, camera, ended) for camera in cameras}
        try:
            for done, (camera, result) in enumerate(waiting.items()):
                on_done(done, len(waiting))
                results[camera] = result.result()
        except BaseException:
            ended.set()
            pool.shutdown(cancel_futures=True)
            raise
        on_done(len(waiting), len(waiting))
    return results
