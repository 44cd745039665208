"""What static cameras could not see of a body that carries no camera there: its pose is a guess."""

from collections import Counter
from collections.abc import Collection, Iterable

from bodycam_ros.verdict.verdict import Finding, Level

_MOSTLY = 0.5
"""Share of the instants; a segment that is seen in fewer is held by its joints and its past most of the time."""


class SeenSegments:
    """Counts at how many instants static cameras saw each segment."""

    def __init__(self) -> None:
        self._instants = 0
        self._seen: Counter[str] = Counter()

    def add(self, segments: Iterable[str]) -> None:
        """One instant, and the segments that any of them saw."""
        self._instants += 1
        self._seen.update(set(segments))

    def findings(self, wanted: Collection[str]) -> tuple[Finding, ...]:
        """A finding for each of the segments that nobody else sees, and they seldom did."""
        if not self._instants:
            return ()
        shares = {segment: self._seen[segment] / self._instants for segment in wanted}
        return tuple(
            Finding(
                segment,
                Level.DOUBTFUL,
                f"static cameras saw it at {share:.0%} of their instants, and it carries none",
                "hidden, lost, or of the colours of what is behind it",
                "let another camera see it",
                part="segment",
            )
            for segment, share in shares.items()
            if share < _MOSTLY
        )
