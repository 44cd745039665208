"""Diagnostics of a node that processes the images of one camera."""

import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from bodycam_ros.live.dropped_messages import DroppedMessages
from bodycam_ros.live.image_queue import THINNED, ImageQueue
from bodycam_ros.messages.diagnostics import Status, StatusLevel

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

    def mean(self, total: float) -> float:
        """Mean of a total over the images."""
        return round(total / max(1, self.images), 1)


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

    def report(self, missing: MissingInput, values: Mapping[str, object], error: str = "") -> Status:
        """Status of the camera since the last report.

        Args:
            missing: why images are not processed.
            values: figures of the node.
            error: what is wrong with the results of the images that were processed.
        """
        tally, self.tally = self.tally, ImageTally()
        arrived, self._images.arrived = self._images.arrived, 0
        lost = self._dropped.count_new()
        level, text = StatusLevel.OK, "tracking"
        if not tally.images:
            level, text = self._judge_idle(arrived, lost, missing)
        elif error:
            level, text = StatusLevel.ERROR, error
        elif self._images.thinning.active:
            level, text = StatusLevel.WARN, THINNED
        elif lost:
            level, text = StatusLevel.WARN, f"tracking, but some input was left out: {self._dropped.latest}"
        figures = {
            "images per second": arrived,
            "tracked per second": tally.images,
            **values,
            "latency [ms]": round(1e3 * tally.latency_s / tally.images, 1) if tally.images else "none",
            "images waiting": len(self._images),
            "restarts": self.restarts,
            **self._dropped.values,
        }
        return Status(f"camera {self._camera}", level, text, figures)

    def _judge_idle(self, arrived: int, lost: int, missing: MissingInput) -> tuple[StatusLevel, str]:
        if len(self._images):
            return StatusLevel.ERROR, f"no image is tracked: {missing.waiting}"
        if arrived and lost:
            return StatusLevel.ERROR, f"none of the images can be used: {self._dropped.latest}"
        if arrived or missing.quiet_s < _PATIENCE_S:
            return StatusLevel.OK, "between two images"
        return StatusLevel.ERROR, missing.no_image
