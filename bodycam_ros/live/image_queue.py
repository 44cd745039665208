"""Images of a camera that wait until a node has time for them, in order of time, from any transport."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.errors import RecordingError
from bodycam_ros.live.dropped_messages import DroppedMessages
from bodycam_ros.live.every_second_image import EverySecondImage
from bodycam_ros.live.stamp_order import Ordered, StampOrder
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.images import TRANSPORTS, image_stamp_ns
from bodycam_ros.moments import Moment, Moments
from bodycam_ros.recording.video_decoder import VideoDecoder

_RECOVERY_S = 5.0
"""All images are used again after so long without one that waited a quarter of the longest wait."""

THINNED = "every second image left out, the machine does not keep up"


@dataclass(frozen=True)
class QueuedImage:
    """An image and its arrival on the steady clock [s]."""

    image: CameraImage
    arrival_s: float


class ImageQueue:
    """A camera's images; the oldest are dropped if too many wait.

    Args:
        camera: its name.
        dropped: counts images that cannot be used.
        moments: notes when images arrive.
        capacity: images that may wait.
        longest_wait_s: every second image is left out after one has waited longer; 0: none is.
        on_image: called after images were added.
        waiting_reason: returns why images wait, for the report on a dropped one.

    Attributes:
        arrived: images since the last report.
        thinning: decides which images are left out.
    """

    def __init__(
        self,
        camera: str,
        dropped: DroppedMessages,
        moments: Moments,
        capacity: int,
        longest_wait_s: float,
        on_image: Callable[[], None],
        waiting_reason: Callable[[], str],
    ) -> None:
        self._camera, self._dropped, self._moments, self._capacity = camera, dropped, moments, capacity
        self._on_image, self._waiting_reason = on_image, waiting_reason
        self.thinning = EverySecondImage(longest_wait_s, _RECOVERY_S)
        self.clear()

    def clear(self) -> None:
        """Drop all images; the next one has no predecessor."""
        self._decoder = VideoDecoder()
        self._order: StampOrder[QueuedImage] = StampOrder(self._reject_stray)
        self._waiting: deque[Ordered[QueuedImage]] = deque()
        self.arrived = 0

    def __len__(self) -> int:
        return len(self._waiting)

    @property
    def oldest(self) -> Ordered[QueuedImage]:
        """The image that is taken next; there must be one."""
        return self._waiting[0]

    @property
    def newest_ns(self) -> int:
        """Stamp of the latest image; there must be one."""
        return self._waiting[-1].item.image.stamp_ns

    def take(self, since_s: float) -> CameraImage | None:
        """Take the oldest image; None if it is left out because the machine does not keep up.

        Args:
            since_s: start of the time in which images wait for nothing but processing, on the steady clock.
        """
        queued, now_s = self._waiting.popleft().item, time.monotonic()
        if not self.thinning.leaves_out(queued.image.stamp_ns, now_s - max(queued.arrival_s, since_s), now_s):
            return queued.image
        self._dropped.add("images left out", f"camera {self._camera}: {THINNED}")
        return None

    def poll(self) -> None:
        """Add images with an odd stamp that no later one has contradicted; call it regularly."""
        self._append(self._order.poll())

    def add(self, message: Message, transport: str) -> None:
        """Add an image of a transport of ``TRANSPORTS``."""
        self.arrived += 1
        now_s, stamp = time.monotonic(), image_stamp_ns(message)
        self._moments.note(Moment.IMAGE_RECEIVED, self._camera, stamp)
        if stamp <= 0:
            self._dropped.add("images without a stamp", f"camera {self._camera}: an image has the stamp {stamp} ns")
            return
        for image in self._convert(message, transport):
            self._append(self._order.add(image.stamp_ns, QueuedImage(image, now_s)))

    def _convert(self, message: Message, transport: str) -> list[CameraImage]:
        """Images, still encoded except for video, of which every frame is needed to decode the next.

        A malformed image raises its error when it is decoded.
        """
        try:
            image = TRANSPORTS[transport].convert(message, self._camera)
        except RecordingError as error:
            image = CameraImage(self._camera, image_stamp_ns(message), error)
        return self._decoder.feed(image)

    def _reject_stray(self, reason: str) -> None:
        self._dropped.add("images out of time", f"camera {self._camera}: {reason}")

    def _append(self, images: list[Ordered[QueuedImage]]) -> None:
        for image in images:
            self._waiting.append(image)
            if len(self._waiting) > self._capacity:
                lost = self._waiting.popleft()
                if lost.restarts:
                    self._waiting[0] = Ordered(self._waiting[0].item, True)
                reason = f"camera {self._camera}: {self._waiting_reason()}; an image is dropped"
                self._dropped.add("images dropped", reason)
        if images:
            self._on_image()
