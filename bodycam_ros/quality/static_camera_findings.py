"""Quality of a body followed by static cameras: segments without support in the images, and misplaced cameras."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.results.verdict import Finding, Level

_MIN_SHARE = 0.5  # of the states, in which static cameras should observe a segment that carries no camera
_MIN_SPAN_S = 0.25  # of an unsupported segment; shorter ones pass before they move anything
_LATE = 10  # states after which a loss, or its end, is noticed: support is smoothed over as many
_WRONG_SPAN_S, _WRONG_SHARE = 1.0, 0.15  # of a segment that images contradict, from which on a result is wrong
_WRONG_UNSUPPORTED_SHARE = 0.5  # the same of one that they contradict or have not shown yet
_MISPLACED_SHARE = 0.25  # of the states
_MAX_SPANS = 3  # that are listed


class StaticCameraLog:
    """Collects what static cameras observed."""

    def __init__(self) -> None:
        self._stamps_ns: list[int] = []
        self._unsupported: dict[str, set[int]] = {}
        self._not_yet_shown: dict[str, set[int]] = {}
        self._found: dict[str, list[int]] = {}  # states
        self._observed: Counter[str] = Counter()
        self._misplaced: Counter[str] = Counter()

    def add(
        self,
        stamp_ns: int,
        observed: Collection[str],
        unsupported: Collection[str],
        misplaced: Collection[str],
        found: Collection[str] = (),
        not_yet_shown: Collection[str] = (),
    ) -> None:
        """Add a state.

        Args:
            stamp_ns: of its first image [ns].
            observed: segments.
            unsupported: segments that the images do not show where the body has them.
            misplaced: cameras whose images do not show the body where the others have it.
            found: segments that were elsewhere in the states before, or are in those that follow.
            not_yet_shown: unsupported segments that no image has shown yet, and none contradicts.
        """
        number = len(self._stamps_ns)
        for segment in found if number else ():
            self._found.setdefault(segment, []).append(number)
        for segment in unsupported:
            self._unsupported.setdefault(segment, set()).add(number)
        for segment in not_yet_shown:
            self._not_yet_shown.setdefault(segment, set()).add(number)
        self._stamps_ns.append(stamp_ns)
        self._observed.update({*observed, *unsupported})
        self._misplaced.update(misplaced)

    def add_measured(self, stamps_ns: Mapping[str, int], measured: StaticMeasurement, segments: Sequence[str]) -> None:
        """Add a measurement of a body's segments, with the stamp of each camera's image [ns]."""
        unsupported, found, not_yet_shown = (
            [segments[row] for row in rows] for rows in (measured.unsupported, measured.found, measured.not_yet_shown)
        )
        stamp_ns = min(stamps_ns.values())
        self.add(stamp_ns, measured.observed, unsupported, measured.misplaced, found, not_yet_shown)

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
            unsupported = self._unsupported.get(segment, set())
            runs = _runs(unsupported, seconds, _LATE)
            lost = [(max(first - _LATE, 0), last) for first, last in runs]
            found = [
                (max(number - _LATE, 0), min(number + _LATE, len(seconds)) - 1)
                for number in self._found.get(segment, [])
            ]
            named = _merged(lost + found, _LATE)
            spans = [(seconds[first], seconds[last]) for first, last in named]
            if not spans:
                continue
            contradicted = unsupported - self._not_yet_shown.get(segment, set())
            lengths_s, unsupported_s = (
                [float(seconds[last] - seconds[first]) for first, last in _runs(rows, seconds)]
                for rows in (contradicted, unsupported)
            )
            is_wrong = (
                max(lengths_s, default=0.0) > _WRONG_SPAN_S
                or sum(lengths_s) > _WRONG_SHARE * float(seconds[-1])
                or sum(unsupported_s) > _WRONG_UNSUPPORTED_SHARE * float(seconds[-1])
            )
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


def _runs(rows: set[int], seconds: NDArray[np.float64], apart: int = 1) -> list[tuple[int, int]]:
    """First and last state of each run of rows that lasts long enough; rows of one run are ``apart`` states at most."""
    runs = _merged([(row, row) for row in rows], apart)
    return [(first, last) for first, last in runs if seconds[last] - seconds[first] >= _MIN_SPAN_S]


def _merged(spans: list[tuple[int, int]], apart: int) -> list[tuple[int, int]]:
    """Spans in order; those that are a few states ``apart`` or less are one."""
    merged: list[tuple[int, int]] = []
    for first, last in sorted(spans):
        if merged and first <= merged[-1][1] + apart:
            merged[-1] = merged[-1][0], max(last, merged[-1][1])
        else:
            merged.append((first, last))
    return merged
