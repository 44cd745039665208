"""Images of a camera that wait until a node has time for them, in order of time, whatever way they come."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.errors import RecordingError
from bodycam_ros.live.flow_of_frames import Ordered, OrderOfTime, Skipped
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.images import compressed_image, compressed_video, image_stamp_ns, raw_image
from bodycam_ros.moments import Moment, Moments
from bodycam_ros.tracking.every_second_image import EverySecondImage
from bodycam_ros.video.video_decoder import VideoDecoder

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
