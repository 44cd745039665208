"""Quality of a body followed by static cameras: segments without support in the images, and misplaced cameras."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.results.verdict import Finding, Level

_MIN_SHARE = 0.5  # of the states, in which static cameras should observe a segment that carries no camera
_MIN_SPAN_S = 0.25  # of an unsupported segment; shorter ones pass before they move anything
_LATE = 10  # states after which a loss is noticed: support is smoothed over as many
_WRONG_SPAN_S, _WRONG_SHARE = 1.0, 0.15  # of an unsupported segment, from which on a result is wrong
_MISPLACED_SHARE = 0.25  # of the states
_MAX_SPANS = 3  # that are listed


class StaticCameraLog:
    """Collects what static cameras observed."""

    def __init__(self) -> None:
        self._stamps_ns: list[int] = []
        self._unsupported: dict[str, set[int]] = {}
        self._before_found: dict[str, list[tuple[int, int]]] = {}  # first and last state
        self._observed: Counter[str] = Counter()
        self._misplaced: Counter[str] = Counter()

    def add(
        self,
        stamp_ns: int,
        observed: Collection[str],
        unsupported: Collection[str],
        misplaced: Collection[str],
        found: Collection[str] = (),
    ) -> None:
        """Add a state.

        Args:
            stamp_ns: of its first image [ns].
            observed: segments.
            unsupported: segments that the images do not show where the body has them.
            misplaced: cameras whose images do not show the body where the others have it.
            found: segments that were elsewhere in the states before.
        """
        number = len(self._stamps_ns)
        for segment in found if number else ():
            self._before_found.setdefault(segment, []).append((max(number - _LATE, 0), number - 1))
        for segment in unsupported:
            self._unsupported.setdefault(segment, set()).add(len(self._stamps_ns))
        self._stamps_ns.append(stamp_ns)
        self._observed.update({*observed, *unsupported})
        self._misplaced.update(misplaced)

    def add_measured(self, stamps_ns: Mapping[str, int], measured: StaticMeasurement, segments: Sequence[str]) -> None:
        """Add a measurement of a body's segments, with the stamp of each camera's image [ns]."""
        unsupported = [segments[row] for row in measured.unsupported]
        found = [segments[row] for row in measured.found]
        self.add(min(stamps_ns.values()), measured.observed, unsupported, measured.misplaced, found)

    def findings(self, wanted: Collection[str]) -> Iterator[Finding]:
        """Findings on segments and cameras.

        Args:
            wanted: segments that carry no camera, and should be observed by static ones.
        """
        if not self._stamps_ns:
            return
        seconds = 1e-9 * (np.array(self._stamps_ns) - self._stamps_ns[0])
        for camera, count in self._misplaced.items():
            if (share := count / len(seconds)) > _MISPLACED_SHARE:
                what = f"its images contradict the body of the other cameras in {share:.0%} of the states"
                why = "its pose or lens in the file is wrong, it was moved, or somebody stood in front of it"
                remedy = (
                    "look at its images; if nobody is in front of it, calibrate it again. It was not used in that time"
                )
                yield Finding(camera, Level.WRONG, what, why, remedy, check="misplaced")
        for segment in wanted:
            rows = np.array(sorted(self._unsupported.get(segment, ())), int)
            runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if len(rows) else []
            runs = [run for run in runs if seconds[run[-1]] - seconds[run[0]] >= _MIN_SPAN_S]
            lengths = [float(seconds[run[-1]] - seconds[run[0]]) for run in runs]
            lost = [(max(int(run[0]) - _LATE, 0), int(run[-1])) for run in runs]
            spans = [
                (seconds[first], seconds[last]) for first, last in _merged(lost + self._before_found.get(segment, []))
            ]
            if not spans:
                continue
            is_wrong = max(lengths, default=0.0) > _WRONG_SPAN_S or sum(lengths) > _WRONG_SHARE * float(seconds[-1])
            when = ", ".join(f"{start_s:.1f} to {end_s:.1f} s" for start_s, end_s in spans[:_MAX_SPANS])
            when += f" and {len(spans) - _MAX_SPANS} more" if len(spans) > _MAX_SPANS else ""
            yield Finding(
                segment,
                Level.WRONG if is_wrong else Level.DOUBTFUL,
                f"the images do not show this segment at its solved pose: {when}",
                "the start file does not have it, tracking lost it, or its colours are those of the background",
                "add it to the start file, or add a camera that sees it; it counts as unobserved in that time",
                part="segment",
                check="unsupported",
            )
        for segment in wanted:
            if (share := self._observed[segment] / len(seconds)) < _MIN_SHARE:
                what = f"static cameras observed it in {share:.0%} of their states, and it carries no body camera"
                why = "it was hidden, tracking lost it, or its colours are those of the background"
                remedy = "add a static camera that sees it"
                yield Finding(segment, Level.DOUBTFUL, what, why, remedy, part="segment", check="unobserved")


def _merged(spans: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """The same states by spans that do not overlap, in order."""
    merged: list[tuple[int, int]] = []
    for first, last in sorted(spans):
        if merged and first <= merged[-1][1] + 1:
            merged[-1] = merged[-1][0], max(last, merged[-1][1])
        else:
            merged.append((first, last))
    return merged
