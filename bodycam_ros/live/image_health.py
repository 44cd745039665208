"""How the images of one camera fare: what came, what was tracked, and what is wrong."""

from collections import Counter
from dataclasses import dataclass, field

from bodycam_ros.live.flow_of_frames import Skipped
from bodycam_ros.live.image_queue import ImageQueue
from bodycam_ros.messages.status import Health, HealthLevel, few

_PATIENCE_S = 2.0
"""Images may come slowly, from a bag that is played slowly; none for so long is an error."""


@dataclass
class Tally:
    """What happened to the images since the last report.

    Attributes:
        images: that were looked at.
        latency_s: from their coming to their result, summed.
        tracks, keyframes: of a tracker.
        seen, confidence: of a region tracker: how often each segment was seen, and how surely, summed.
    """

    images: int = 0
    latency_s: float = 0.0
    tracks: int = 0
    keyframes: int = 0
    seen: Counter[str] = field(default_factory=Counter)
    confidence: float = 0.0

    @property
    def latency_ms(self) -> object:
        """Mean; "none" without an image."""
        return round(1e3 * self.latency_s / self.images, 1) if self.images else "none"


class ImageHealth:
    """Counts the images of a camera between two reports, and judges them.

    Args:
        camera: its name.
        images, skipped: what waits, and what could not be used.

    Attributes:
        tally: since the last report.
        restarts: how often the camera began anew.
    """

    def __init__(self, camera: str, images: ImageQueue, skipped: Skipped) -> None:
        self._camera, self._images, self._skipped = camera, images, skipped
        self.tally = Tally()
        self.restarts = 0

    def of_tracker(
        self, quiet_s: float, no_image: str, lacking: str, has_info: bool, lens: tuple[str, str], info_changes: int
    ) -> Health:
        """The report of a tracker.

        Args:
            quiet_s: how long no image has come [s].
            no_image: why none comes.
            lacking: why those that wait are not tracked.
            has_info: whether there is a camera_info.
            lens: what is known of the lens, and what is wrong with it, or "".
            info_changes: how often the camera_info became another.
        """
        tally, arrived, lost = self._take()
        values: dict[str, object] = {
            "images per second": arrived,
            "tracked per second": tally.images,
            "tracks per image": round(tally.tracks / max(1, tally.images), 1),
            "keyframes": tally.keyframes,
            "latency [ms]": tally.latency_ms,
            "images waiting": len(self._images),
            "times begun anew": self.restarts,
            "camera_info changed": info_changes,
            "lens": lens[0],
            **self._skipped.counts,
            "last error": self._skipped.latest or "none",
        }
        without_info = "" if has_info else f", and no {self._camera}/camera_info"
        if not tally.images and not has_info and (arrived or len(self._images)):
            level, text = HealthLevel.ERROR, f"images, but no {self._camera}/camera_info"
        elif not tally.images:
            level, text = self._without_images(
                arrived, lost, quiet_s, no_image + without_info, f"no image is tracked: {lacking}"
            )
        elif not tally.tracks:
            level, text = HealthLevel.ERROR, "the images show nothing that can be tracked; is the lens covered?"
        elif lens[1]:
            level, text = HealthLevel.WARN, lens[1]
        else:
            level, text = self._with_images("tracking", lost)
        return Health(f"camera {self._camera}", level, text, values)

    def of_region_tracker(self, quiet_s: float, no_image: str, lacking: str, segments: tuple[str, ...]) -> Health:
        """The report of a region tracker; arguments as above, and the names of the body's segments."""
        tally, arrived, lost = self._take()
        seen = tally.seen.total()
        values: dict[str, object] = {
            "images per second": arrived,
            "looked at per second": tally.images,
            "latency [ms]": tally.latency_ms,
            "images waiting": len(self._images),
            "segments per image": round(seen / max(1, tally.images), 1),
            "confidence": round(tally.confidence / seen, 2) if seen else "none",
            "times begun anew": self.restarts,
            **self._skipped.counts,
            "last error": self._skipped.latest or "none",
        }
        unseen = [segment for segment in segments if not tally.seen[segment]]
        if not tally.images:
            lacking = f"no image is looked at: {lacking or 'the one before takes long'}"
            level, text = self._without_images(arrived, lost, quiet_s, no_image, lacking)
        elif not seen:
            level, text = HealthLevel.ERROR, "no segment of the body is seen; is it before the camera?"
        else:
            level, text = self._with_images("looking", lost)
            if level is HealthLevel.OK and unseen:
                text = f"looking; sees nothing of {few(unseen)}"
        return Health(f"camera {self._camera}", level, text, values)

    def _take(self) -> tuple[Tally, int, int]:
        tally, self.tally = self.tally, Tally()
        return tally, self._images.count(), self._skipped.lately()

    def _without_images(
        self, arrived: int, lost: int, quiet_s: float, no_image: str, lacking: str
    ) -> tuple[HealthLevel, str]:
        if len(self._images):
            return HealthLevel.ERROR, lacking
        if arrived and lost:
            return HealthLevel.ERROR, f"none of the images can be used: {self._skipped.latest}"
        if arrived or quiet_s < _PATIENCE_S:
            return HealthLevel.OK, "between two images"
        return HealthLevel.ERROR, no_image

    def _with_images(self, working: str, lost: int) -> tuple[HealthLevel, str]:
        if self._images.is_thinned:
            return HealthLevel.WARN, self._images.is_thinned
        if lost:
            return HealthLevel.WARN, f"{working}, but some input was left out: {self._skipped.latest}"
        return HealthLevel.OK, working
