"""Quality of a body followed by static cameras: segments that they do not support, and cameras that are misplaced."""

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from itertools import groupby

from bodycam_ros.verdict import Finding, Level

_MIN_SHARE = 0.5  # of the instants, in which static cameras should observe a segment that carries no camera
_MIN_SPAN_S = 0.25  # of an unsupported segment; shorter ones pass before they move anything
_WRONG_SPAN_S, _WRONG_SHARE = 1.0, 0.15  # of an unsupported segment, from which on a result is wrong
_MISPLACED_SHARE = 0.25  # of the instants


class StaticCameraLog:
    """Collects what static cameras observed."""

    def __init__(self) -> None:
        self._stamps_ns: list[int] = []
        self._unsupported: dict[str, set[int]] = {}
        self._observed: Counter[str] = Counter()
        self._misplaced: Counter[str] = Counter()

    def add(
        self, stamp_ns: int, observed: Collection[str], unsupported: Collection[str], misplaced: Collection[str]
    ) -> None:
        """Add an instant.

        Args:
            stamp_ns: of its first image [ns].
            observed: segments.
            unsupported: segments that the images do not show where the body has them.
            misplaced: cameras whose images do not show the body where the others have it.
        """
        for segment in unsupported:
            self._unsupported.setdefault(segment, set()).add(len(self._stamps_ns))
        self._stamps_ns.append(stamp_ns)
        self._observed.update({*observed, *unsupported})
        self._misplaced.update(misplaced)

    def findings(self, wanted: Collection[str]) -> tuple[Finding, ...]:
        """Findings on segments and cameras.

        Args:
            wanted: segments that carry no camera, and should be observed by static ones.
        """
        if not self._stamps_ns:
            return ()
        return (*self._misplaced_cameras(), *self._unsupported_segments(wanted), *self._rare_segments(wanted))

    def _misplaced_cameras(self) -> Iterator[Finding]:
        for camera, count in self._misplaced.items():
            if (share := count / len(self._stamps_ns)) > _MISPLACED_SHARE:
                yield Finding(
                    camera,
                    Level.WRONG,
                    f"its images do not show the body where the others have it, for {share:.0%} of the time",
                    "its pose or lens is not what the file of static cameras says, or it has been moved",
                    "calibrate it anew; it was left out meanwhile",
                )

    def _unsupported_segments(self, wanted: Collection[str]) -> Iterator[Finding]:
        for segment, rows in self._unsupported.items():
            if segment not in wanted:
                continue
            spans = [(s, e) for s, e in self._spans(sorted(rows)) if e - s >= _MIN_SPAN_S]
            if not spans:
                continue
            total_s = sum(end_s - start_s for start_s, end_s in spans)
            share = total_s / max(1e-9 * (self._stamps_ns[-1] - self._stamps_ns[0]), 1e-9)
            is_wrong = max(end_s - start_s for start_s, end_s in spans) > _WRONG_SPAN_S or share > _WRONG_SHARE
            when = ", ".join(f"{start_s:.1f} to {end_s:.1f} s" for start_s, end_s in spans[:3])
            more = f" and {len(spans) - 3} times more" if len(spans) > 3 else ""
            yield Finding(
                segment,
                Level.WRONG if is_wrong else Level.DOUBTFUL,
                f"the images do not show it where the body has it: {when}{more}",
                "the start did not place it, it was lost, or it has the colours of what is behind it",
                "place it in the start, or let another camera see it; it counts as unobserved in that time",
                part="segment",
            )

    def _spans(self, rows: Sequence[int]) -> Iterator[tuple[float, float]]:
        """Start and end of runs of instants [s since the first]."""
        for _, run in groupby(enumerate(rows), key=lambda item: item[1] - item[0]):
            run_rows = [row for _, row in run]
            yield tuple(1e-9 * (self._stamps_ns[row] - self._stamps_ns[0]) for row in (run_rows[0], run_rows[-1]))  # type: ignore[misc]

    def _rare_segments(self, wanted: Collection[str]) -> Iterator[Finding]:
        for segment in wanted:
            if (share := self._observed[segment] / len(self._stamps_ns)) < _MIN_SHARE:
                yield Finding(
                    segment,
                    Level.DOUBTFUL,
                    f"static cameras observed it at {share:.0%} of their instants, and it carries none",
                    "hidden, lost, or of the colours of what is behind it",
                    "let another camera see it",
                    part="segment",
                )
