"""From stamps alone: which cameras share them, and where a clock was set."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Stamps = NDArray[np.int64]

_SHARED_NS = 500_000  # stamps of one trigger differ by less
_SHARED_PERIOD = 0.015  # of the time between two images; free-running clocks meet so closely once in thirty
_BREAK_NS, _BREAK_SHARE = 4_000_000, 0.2  # off a multiple of the period, or by such a share; jitter is less
_ODD_SHARE = 0.1  # of the intervals; with more the rate varies, and a gap is no break
_LEAST_INTERVALS = 20


@dataclass(frozen=True)
class SharedStamps:
    """Which cameras share their stamps.

    Attributes:
        cameras: those that do: most of them, or none.
        period_ns: time between two images of a camera; the median of all [ns].
        reference: the camera whose clock is the body's.
    """

    cameras: frozenset[str]
    period_ns: int
    reference: str


def find_shared_stamps(
    stamps_ns: Mapping[str, Stamps], preferred: tuple[str, ...] = (), alone: bool = False
) -> SharedStamps:
    """Find the cameras with the same stamps, if they are most.

    Args:
        stamps_ns: camera -> its stamps, ascending; at least one of one camera [ns].
        preferred: cameras that should be the reference, the first that shares the stamps.
        alone: whether there is only one camera so far, whose stamps are used as they are.
    """
    several = {camera: stamps for camera, stamps in stamps_ns.items() if len(stamps) > 1}
    if not several:
        return SharedStamps(frozenset(stamps_ns) if alone else frozenset(), 0, next(iter(stamps_ns)))
    groups = ([other for other, theirs in several.items() if share_stamps(theirs, own)] for own in several.values())
    shared = frozenset(next((group for group in groups if alone or 2 * len(group) > max(2, len(several))), ()))
    reference = next(camera for camera in (*preferred, *sorted(several)) if camera in (shared or several))
    period = np.median([np.median(np.diff(stamps)) for stamps in several.values()])
    return SharedStamps(shared, round(float(period)), reference)


def share_stamps(own_ns: Stamps, other_ns: Stamps) -> bool:
    """Whether most stamps (N) of a camera are those (M) of another, where both have images [ns]."""
    period_ns = float(np.median(np.diff(own_ns))) if len(own_ns) > 1 else np.inf
    inside = own_ns[(own_ns >= other_ns[0] - _SHARED_NS) & (own_ns <= other_ns[-1] + _SHARED_NS)]
    if not len(inside):
        return False
    after = np.minimum(np.searchsorted(other_ns, inside), len(other_ns) - 1)
    off_ns = np.minimum(np.abs(other_ns[after] - inside), np.abs(other_ns[np.maximum(after - 1, 0)] - inside))
    return bool(np.median(off_ns) < min(_SHARED_NS, _SHARED_PERIOD * period_ns))


def find_break(stamps_ns: Stamps) -> int | None:
    """The first stamp of a camera's (N) that came at an odd interval, as where its clock was set [ns], if there is one.

    None where the rate varies, so that most intervals are no multiples of one period.
    """
    intervals = np.diff(stamps_ns).astype(np.float64)
    if len(intervals) <= _LEAST_INTERVALS:
        return None
    period = float(np.median(intervals))
    off = np.abs(intervals - np.maximum(1.0, np.rint(intervals / period)) * period)
    is_odd = off > min(_BREAK_NS, _BREAK_SHARE * period)
    return int(stamps_ns[1 + is_odd.argmax()]) if 0.0 < is_odd.mean() < _ODD_SHARE else None
