"""A part of a recording by its own time, and the part in which most of its cameras run."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

LATEST_NS = 2**63 - 1

_MOST = 0.75  # share of the cameras, rounded down: one that is late or ends early cuts nothing off four or more
_LEAST_CUT_NS = 200_000_000  # at either end; cameras that are started together differ by less


@dataclass(frozen=True)
class TimeSpan:
    """Part of a recording, in seconds since its first image; to an infinite time for all of the rest."""

    from_s: float = 0.0
    to_s: float = math.inf

    @property
    def text(self) -> str:
        """As a user reads it: from 1.5 s to 7 s."""
        return f"from {self.from_s:g} s to {'the end' if math.isinf(self.to_s) else f'{self.to_s:g} s'}"

    def window_ns(self, first_ns: int) -> tuple[int, int]:
        """First stamp of the part, and the stamp after its last [ns].

        Args:
            first_ns: stamp of the recording's first image.
        """
        end_ns = LATEST_NS if math.isinf(self.to_s) else first_ns + round(1e9 * self.to_s)
        return first_ns + round(1e9 * self.from_s), min(end_ns, LATEST_NS)


def most_cameras_window(spans_ns: Mapping[str, tuple[int, int]]) -> tuple[int, int]:
    """First stamp at which most cameras run, and the stamp after the last one [ns]; of all images where none are few.

    Args:
        spans_ns: camera -> stamps of its first and last image [ns].
    """
    needed = max(1, math.floor(_MOST * len(spans_ns)))
    firsts, lasts = (sorted(span[end] for span in spans_ns.values()) for end in (0, 1))
    start_ns, end_ns = firsts[needed - 1], lasts[len(lasts) - needed]
    if end_ns <= start_ns:
        return firsts[0], lasts[-1] + 1
    start_ns = firsts[0] if start_ns - firsts[0] < _LEAST_CUT_NS else start_ns
    end_ns = lasts[-1] if lasts[-1] - end_ns < _LEAST_CUT_NS else end_ns
    return start_ns, end_ns + 1
