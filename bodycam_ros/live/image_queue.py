"""Images of a camera that wait until a node has time for them, in order of time, whatever way they come."""

import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field

from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.errors import RecordingError
from bodycam_ros.live.flow_of_frames import Ordered, OrderOfTime, Skipped
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.health import Health, HealthLevel, few
from bodycam_ros.messages.images import compressed_image, compressed_video, image_stamp_ns, raw_image
from bodycam_ros.moments import Moment, Moments
from bodycam_ros.recording.video_decoder import VideoDecoder
from bodycam_ros.tracking.every_second_image import EverySecondImage

_CONVERTERS = {"compressed": compressed_image, "raw": raw_image}
_THINNED = "every second image left out, the machine does not keep up"


@dataclass(frozen=True)
class QueuedImage:
    """An image, and when it came, on the steady clock."""

    image: CameraImage
    seconds: float


class ImageQueue:
    """A camera's images, as messages bring them; the oldest go when too many wait.

    Args:
        camera: its name.
        skipped: counts what cannot be used.
        moments: notes when images come.
        longest: images that may wait.
        thinning: whether every second image is left out.
        on_more: called when there are more.
        what_is_lacking: why images wait, for whom one is dropped.

    Attributes:
        arrived: images since the last ``count``.
    """

    def __init__(
        self,
        camera: str,
        skipped: Skipped,
        moments: Moments,
        longest: int,
        thinning: EverySecondImage,
        on_more: Callable[[], None],
        what_is_lacking: Callable[[], str],
    ) -> None:
        self._camera, self._skipped, self._moments, self._longest = camera, skipped, moments, longest
        self._thinning, self._on_more, self._what_is_lacking = thinning, on_more, what_is_lacking
        self.forget()

    def forget(self) -> None:
        """What waits is of no use any more, and the next image follows none."""
        self._decoder = VideoDecoder()
        self._order: OrderOfTime[QueuedImage] = OrderOfTime(self._on_stray)
        self._waiting: deque[Ordered[QueuedImage]] = deque()
        self.arrived = 0

    def __len__(self) -> int:
        return len(self._waiting)

    @property
    def next(self) -> Ordered[QueuedImage]:
        """The oldest; there is one."""
        return self._waiting[0]

    @property
    def newest_ns(self) -> int:
        """Stamp of the latest; there is one."""
        return self._waiting[-1].item.image.stamp_ns

    def take(self, since_s: float) -> CameraImage | None:
        """Take the oldest; None where it is left out, because the machine does not keep up.

        Args:
            since_s: since when images wait because others are looked at, and for nothing else, on the steady clock.
        """
        queued, now_s = self._waiting.popleft().item, time.monotonic()
        if not self._thinning.leaves_out(queued.image.stamp_ns, now_s - max(queued.seconds, since_s), now_s):
            return queued.image
        self._skipped.add("images left out", f"camera {self._camera}: {_THINNED}")
        return None

    def look(self) -> None:
        """Call it now and then: nothing may have contradicted an odd stamp for a while."""
        self._wait(self._order.look())

    def count(self) -> int:
        """How many have arrived since the last call of this."""
        arrived, self.arrived = self.arrived, 0
        return arrived

    @property
    def is_thinned(self) -> str:
        """Why not every image is looked at; empty if all are."""
        return _THINNED if self._thinning.active else ""

    def receive(self, message: Message, transport: str) -> None:
        """An image has come, on a transport of ``camera_topics.TRANSPORTS``."""
        self.arrived += 1
        now_s, stamp = time.monotonic(), image_stamp_ns(message)
        self._moments.note(Moment.IMAGE_HEARD, self._camera, stamp)
        if stamp <= 0:
            self._skipped.add("images without a stamp", f"camera {self._camera}: an image has the stamp {stamp} ns")
            return
        for image in self._images(message, transport):
            self._wait(self._order.add(image.stamp_ns, QueuedImage(image, now_s)))

    def _images(self, message: Message, transport: str) -> list[CameraImage]:
        """Still encoded, except for videos: every frame of these is decoded, for the next one is made of it.

        One that is malformed says so where it is looked at.
        """
        try:
            if transport in _CONVERTERS:
                return [_CONVERTERS[transport](message, self._camera)]
            image = compressed_video(message, self._camera)
        except RecordingError as error:
            image = CameraImage(self._camera, image_stamp_ns(message), error)
        return [image] if transport in _CONVERTERS else self._decoder.feed(image)

    def _on_stray(self, reason: str) -> None:
        self._skipped.add("images out of time", f"camera {self._camera}: {reason}")

    def _wait(self, images: list[Ordered[QueuedImage]]) -> None:
        for image in images:
            self._waiting.append(image)
            if len(self._waiting) > self._longest:
                lost = self._waiting.popleft()
                if lost.begins_anew:
                    self._waiting[0] = Ordered(self._waiting[0].item, True)
                reason = f"camera {self._camera}: {self._what_is_lacking()}; an image is dropped"
                self._skipped.add("images dropped", reason)
        if images:
            self._on_more()


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
