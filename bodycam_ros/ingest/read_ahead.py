"""Several streams that are made at the same time, merged in order of time, in bounded memory."""

import heapq
import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Generic, TypeVar

T = TypeVar("T")

_QUEUE_LENGTH = 16
_POLL_S = 0.2


@contextmanager
def merged_ahead(streams: Sequence[Iterator[T]], order: Callable[[T], int], jobs: int) -> Iterator[Iterator[T]]:
    """Merge ordered streams, each made on a thread of its own.

    The heavy work, to decode and to compress, leaves Python to the other threads meanwhile. An error in a stream is
    raised where its item would have come; however the block ends, all threads have ended after it.

    Args:
        streams: what to merge; each is used by one thread only.
        order: of an item.
        jobs: threads that may work at the same time.
    """
    stopped = threading.Event()
    turn = threading.Semaphore(jobs)
    producers = [_Producer(stream, turn, stopped) for stream in streams]
    try:
        yield heapq.merge(*(producer.items() for producer in producers), key=order)
    finally:
        stopped.set()
        for producer in producers:
            producer.thread.join()


class _Producer(Generic[T]):
    def __init__(self, stream: Iterator[T], turn: threading.Semaphore, stopped: threading.Event) -> None:
        self._stream = stream
        self._turn = turn
        self._stopped = stopped
        self._made: queue.Queue[list[T] | BaseException] = queue.Queue(_QUEUE_LENGTH)
        self.thread = threading.Thread(target=self._make, daemon=True)
        self.thread.start()

    def items(self) -> Iterator[T]:
        while True:
            made = self._made.get()
            if isinstance(made, BaseException):
                raise made
            if not made:
                return
            yield from made

    def _make(self) -> None:
        try:
            while not self._stopped.is_set():
                with self._turn:
                    item = next(self._stream, None)
                self._put([] if item is None else [item])
                if item is None:
                    return
        except BaseException as error:  # whatever it is, it is raised where the stream is read
            self._put(error)

    def _put(self, made: list[T] | BaseException) -> None:
        while not self._stopped.is_set():
            try:
                return self._made.put(made, timeout=_POLL_S)
            except queue.Full:
                continue
