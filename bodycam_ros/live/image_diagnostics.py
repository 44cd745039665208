"""Diagnostics of a node that processes the images of one camera."""

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from bodycam_ros.live.dropped_messages import DroppedMessages
from bodycam_ros.live.image_queue import THINNED, ImageQueue
from bodycam_ros.messages.diagnostics import Status, StatusLevel, few

_PATIENCE_S = 2.0
"""A gap without images that is an error; images may arrive slowly from a bag that is played slowly."""


@dataclass
class ImageTally:
    """Counts since the last report.

    Attributes:
        images: processed images.
        latency_s: from arrival to result, summed [s].
        tracks, keyframes: of a tracker.
        segments: of a region tracker: images in which each segment was observed.
        confidence: of these segments, summed.
    """

    images: int = 0
    latency_s: float = 0.0
    tracks: int = 0
    keyframes: int = 0
    segments: Counter[str] = field(default_factory=Counter)
    confidence: float = 0.0

    def add_image(self, arrival_s: float) -> None:
        """Count an image whose result is published now."""
        self.images += 1
        self.latency_s += time.monotonic() - arrival_s


@dataclass(frozen=True)
class MissingInput:
    """Why images are not processed.

    Attributes:
        quiet_s: time since the last image [s].
        no_image: reason why no image arrives.
        waiting: reason why images wait.
    """

    quiet_s: float
    no_image: str
    waiting: str


class ImageDiagnostics:
    """Counts the images of a camera between two reports.

    Args:
        camera: its name.
        images, dropped: images that wait, and images that could not be used.

    Attributes:
        tally: counts since the last report.
        restarts: number of restarts of the camera.
    """

    def __init__(self, camera: str, images: ImageQueue, dropped: DroppedMessages) -> None:
        self._camera, self._images, self._dropped = camera, images, dropped
        self.tally = ImageTally()
        self.restarts = 0

    def report_tracker(self, missing: MissingInput, has_info: bool, lens: tuple[str, str], info_changes: int) -> Status:
        """Status of a tracker since the last report.

        Args:
            missing: why images are not tracked.
            has_info: whether there is a camera_info.
            lens: state of the lens check, and its finding or "".
            info_changes: number of changes of the camera_info.
        """
        info = f"no {self._camera}/camera_info"

        def judge(tally: ImageTally, arrived: int, lost: int) -> tuple[StatusLevel, str]:
            if not tally.images and not has_info and (arrived or len(self._images)):
                return StatusLevel.ERROR, f"images, but {info}"
            if not tally.images:
                return self._judge_idle(arrived, lost, missing, "tracked", "" if has_info else f", and {info}")
            if not tally.tracks:
                return StatusLevel.ERROR, "the images show nothing that can be tracked; is the lens covered?"
            return (StatusLevel.WARN, lens[1]) if lens[1] else self._judge_working("tracking", lost)

        def values(tally: ImageTally) -> dict[str, object]:
            return {
                "tracked per second": tally.images,
                "tracks per image": round(tally.tracks / max(1, tally.images), 1),
                "keyframes": tally.keyframes,
                "camera_info changed": info_changes,
                "lens": lens[0],
            }

        return self._report(values, judge)

    def report_region_tracker(self, missing: MissingInput, segments: tuple[str, ...]) -> Status:
        """Status of a region tracker since the last report; ``segments`` are those of the body."""

        def judge(tally: ImageTally, arrived: int, lost: int) -> tuple[StatusLevel, str]:
            if not tally.images:
                return self._judge_idle(arrived, lost, missing, "processed")
            if not tally.segments:
                return StatusLevel.ERROR, "no segment of the body is observed; is it in front of the camera?"
            level, text = self._judge_working("tracking", lost)
            unobserved = [segment for segment in segments if not tally.segments[segment]]
            if level is StatusLevel.OK and unobserved:
                text = f"tracking; unobserved: {few(unobserved)}"
            return level, text

        def values(tally: ImageTally) -> dict[str, object]:
            observed = tally.segments.total()
            return {
                "processed per second": tally.images,
                "segments per image": round(observed / max(1, tally.images), 1),
                "confidence": round(tally.confidence / observed, 2) if observed else "none",
            }

        return self._report(values, judge)

    def _report(
        self,
        values: Callable[[ImageTally], dict[str, object]],
        judge: Callable[[ImageTally, int, int], tuple[StatusLevel, str]],
    ) -> Status:
        tally, self.tally = self.tally, ImageTally()
        arrived, self._images.arrived = self._images.arrived, 0
        level, text = judge(tally, arrived, self._dropped.count_new())
        latency_ms = round(1e3 * tally.latency_s / tally.images, 1) if tally.images else "none"
        figures = {
            "images per second": arrived,
            **values(tally),
            "latency [ms]": latency_ms,
            "images waiting": len(self._images),
            "restarts": self.restarts,
            **self._dropped.values,
        }
        return Status(f"camera {self._camera}", level, text, figures)

    def _judge_idle(
        self, arrived: int, lost: int, missing: MissingInput, verb: str, suffix: str = ""
    ) -> tuple[StatusLevel, str]:
        if len(self._images):
            return StatusLevel.ERROR, f"no image is {verb}: {missing.waiting}"
        if arrived and lost:
            return StatusLevel.ERROR, f"none of the images can be used: {self._dropped.latest}"
        if arrived or missing.quiet_s < _PATIENCE_S:
            return StatusLevel.OK, "between two images"
        return StatusLevel.ERROR, missing.no_image + suffix

    def _judge_working(self, working: str, lost: int) -> tuple[StatusLevel, str]:
        if self._images.thinning.active:
            return StatusLevel.WARN, THINNED
        if lost:
            return StatusLevel.WARN, f"{working}, but some input was left out: {self._dropped.latest}"
        return StatusLevel.OK, working
