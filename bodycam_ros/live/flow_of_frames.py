"""What nodes remember about frames on their way: out of order, not answered yet, lost, left out. Imports no ROS."""

import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

T = TypeVar("T")

_PATIENCE_S = 2.0
"""Without an answer for so long nobody registers this camera, and there is nothing to wait for."""

_REMEMBERED = 1000
"""Frames that an answer may still come to, after a long silence."""

_STEP_NS = 1_000_000_000
"""A stamp further on than this may be a stray one: whether the stream goes on from there, the next stamps tell."""

_CONVINCED = 3
"""Images in a row that follow each other, but not those before, are where the stream is now."""

_CONVINCED_S = 0.5
"""Or one, if nothing else comes for so long."""


@dataclass(frozen=True)
class Ordered(Generic[T]):
    """An item whose place in time is known.

    Attributes:
        item: what it is.
        begins_anew: whether it does not follow what came before: time went back.
    """

    item: T
    begins_anew: bool


class OrderOfTime(Generic[T]):
    """Puts a stream of stamped items in order where stamps stray, and notices where its time begins anew.

    An item whose stamp does not follow the one before waits for the next: if that follows the stream, it was a stray.

    Args:
        on_stray: called with the reason for each item that is left out.
    """

    def __init__(self, on_stray: Callable[[str], object]) -> None:
        self._on_stray = on_stray
        self._latest_ns: int | None = None
        self._doubtful: list[tuple[int, T]] = []
        self._doubtful_since_s = 0.0

    def add(self, stamp_ns: int, item: T) -> list[Ordered[T]]:
        """Add what has arrived; return what is in order now."""
        if self._latest_ns is None or _follows(stamp_ns, self._latest_ns):
            self._drop_doubtful()
            self._latest_ns = stamp_ns
            return [Ordered(item, False)]
        if self._doubtful and not _follows(stamp_ns, self._doubtful[-1][0]):
            self._drop_doubtful()
        self._doubtful.append((stamp_ns, item))
        self._doubtful_since_s = time.monotonic()
        return self._settle() if len(self._doubtful) >= _CONVINCED else []

    def look(self) -> list[Ordered[T]]:
        """What is in order because nothing has contradicted it for a while; call it now and then."""
        waited_s = time.monotonic() - self._doubtful_since_s
        return self._settle() if self._doubtful and waited_s > _CONVINCED_S else []

    def _settle(self) -> list[Ordered[T]]:
        doubtful, self._doubtful = self._doubtful, []
        goes_back = self._latest_ns is not None and doubtful[0][0] <= self._latest_ns
        self._latest_ns = doubtful[-1][0]
        return [Ordered(item, goes_back and number == 0) for number, (_, item) in enumerate(doubtful)]

    def _drop_doubtful(self) -> None:
        for stamp_ns, _ in self._doubtful:
            off_s = 1e-9 * (stamp_ns - (self._latest_ns or 0))
            self._on_stray(
                f"stamp {stamp_ns} ns is {off_s:+.3f} s from the one before, and the stream does not go on there"
            )
        self._doubtful = []


def _follows(stamp_ns: int, before_ns: int) -> bool:
    return before_ns < stamp_ns <= before_ns + _STEP_NS


class AnsweredFrames:
    """Which frames were sent and not answered yet.

    A tracker that runs ahead follows tracks that a prompt answer would have ended, and what it sends grows old in a
    queue: better let images wait, where the oldest can be dropped and counted.

    Args:
        most_ahead: frames that may be on their way.

    Attributes:
        most_ahead: as given; it may be replaced.
        since_s: since when answers come, on the steady clock; None while nobody answers.
    """

    def __init__(self, most_ahead: int) -> None:
        self.most_ahead = most_ahead
        self._unanswered_ns: deque[int] = deque(maxlen=_REMEMBERED)
        self._progress_s = 0.0
        self._alone = False
        self.since_s: float | None = None

    def sent(self, stamp_ns: int) -> None:
        """A frame goes out."""
        if not self._unanswered_ns:
            self._progress_s = time.monotonic()
        self._unanswered_ns.append(stamp_ns)

    def answered(self, stamp_ns: int) -> bool:
        """The answer to a frame, and so to those before it; False if there was no such frame, or long ago."""
        if stamp_ns not in self._unanswered_ns:
            return False
        self._progress_s = time.monotonic()
        self._alone = False
        self.since_s = self.since_s or self._progress_s
        while self._unanswered_ns and self._unanswered_ns[0] <= stamp_ns:
            self._unanswered_ns.popleft()
        return True

    def answered_until(self, stamp_ns: int) -> None:
        """An answer to all frames up to a time, who names none of them."""
        if sent := [sent_ns for sent_ns in self._unanswered_ns if sent_ns <= stamp_ns]:
            self.answered(sent[-1])

    def expect_nobody(self) -> None:
        """Wait for no answer until one comes: who was to answer is gone, or has only just come."""
        self._alone = True
        self.since_s = None

    def forget(self) -> None:
        """Time begins anew: answers to what was sent are of no use."""
        self._unanswered_ns.clear()
        self.since_s = None

    def must_wait(self) -> bool:
        """Whether the next frame has to wait for an answer; not while nobody answers at all."""
        if len(self._unanswered_ns) < self.most_ahead:
            return False
        if time.monotonic() - self._progress_s > _PATIENCE_S:
            self.expect_nobody()
        return not self._alone


class AwaitedReaders:
    """Waits until those who are to read what is said of a camera are there, once for each camera."""

    def __init__(self) -> None:
        self._since_s: dict[str, float] = {}
        self._read: set[str] = set()

    def are_there(self, camera: str, count: Callable[[], int], awaited: int, patience_s: float) -> bool:
        """Whether so many readers are there, or once were, or did not come in time."""
        if camera not in self._read:
            now_s = time.monotonic()
            waited_s = now_s - self._since_s.setdefault(camera, now_s)
            if count() < awaited and waited_s <= patience_s:
                return False
            self._read.add(camera)
        return True


class MissedFrames:
    """Whether messages of a camera got lost on the way: each names the frame before it."""

    def __init__(self) -> None:
        self._latest_ns: dict[str, int] = {}

    def add(self, camera: str, stamp_ns: int, previous_stamp_ns: int) -> bool:
        """Whether the message's predecessor is missing; the first message of a camera has none to miss."""
        latest_ns = self._latest_ns.get(camera)
        self._latest_ns[camera] = stamp_ns
        # A predecessor of 0 is a tracker that has started again.
        return latest_ns is not None and previous_stamp_ns not in (0, latest_ns)


class Skipped:
    """What a node could not use: the first of a kind is warned about, all are counted.

    Args:
        warn: takes a line of text.

    Attributes:
        counts: kind -> how many, since the start.
        latest: why the latest was left out; empty if there was none.
    """

    def __init__(self, warn: Callable[[str], object]) -> None:
        self._warn = warn
        self._reported = 0
        self.counts: Counter[str] = Counter()
        self.latest = ""

    def add(self, kind: str, reason: str) -> None:
        """Count one; ``kind`` is how the count is called in /diagnostics ("images skipped")."""
        self.counts[kind] += 1
        self.latest = reason
        if self.counts[kind] == 1:
            self._warn(f"{reason} (said once; /diagnostics counts them)")

    def lately(self) -> int:
        """How many since the last call of this."""
        before, self._reported = self._reported, self.counts.total()
        return self._reported - before


_LEAST_SHARE = 0.6
"""Of the time between two stamps: so long after the first the second goes on, however early it comes."""

_MOST_WAITING = 3
"""More wait where a recording is played faster than it was recorded, and then nothing is to wait."""

_LONGEST_S = 0.1


class Paced(Generic[T]):
    """Hands on stamped items, not at once where the one before has only just been handed on.

    Args:
        hand_on: called with each item, in order.
    """

    def __init__(self, hand_on: Callable[[T], None]) -> None:
        self._hand_on = hand_on
        self._waiting: deque[tuple[int, T]] = deque()
        self._handed_on_ns, self._due_s = 0, 0.0

    def add(self, stamp_ns: int, item: T) -> None:
        """Take an item, and hand on what is due."""
        self._waiting.append((stamp_ns, item))
        self.look()

    def look(self) -> None:
        """Hand on what is due; call it every few milliseconds."""
        while self._waiting and (len(self._waiting) > _MOST_WAITING or time.monotonic() >= self._due_s):
            self._next()

    def flush(self) -> None:
        """Hand on all."""
        while self._waiting:
            self._next()

    def _next(self) -> None:
        stamp_ns, item = self._waiting.popleft()
        passed_s = min(1e-9 * max(stamp_ns - self._handed_on_ns, 0), _LONGEST_S)
        self._handed_on_ns, self._due_s = stamp_ns, time.monotonic() + _LEAST_SHARE * passed_s
        self._hand_on(item)


class Work(Protocol):
    """What is under way, or done.

    Attributes:
        step, share: what it is doing and how much of that is done, 0 to 1.
    """

    step: str
    share: float

    @property
    def result(self) -> tuple[bool, str] | None:
        """Whether it succeeded, and a summary or the error; None while it is under way."""

    def cancel(self) -> bool:
        """End it without a trace; False where it is too late for that."""
