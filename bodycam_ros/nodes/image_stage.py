"""Part that the tracker and the region tracker share: images of one camera, in order, processed one at a time."""

import time
from abc import abstractmethod
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar

from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.errors import RecordingError
from bodycam_ros.live.every_second_image import EverySecondImage
from bodycam_ros.live.node_parameters import ImageParameters
from bodycam_ros.live.stamp_order import StampOrder
from bodycam_ros.live.unanswered_frames import UnansweredFrames
from bodycam_ros.messages.diagnostics import Status, StatusLevel
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.images import TRANSPORTS, image_stamp_ns
from bodycam_ros.moments import Moment
from bodycam_ros.nodes.camera_topics import ImageSource
from bodycam_ros.nodes.stage_node import Stage, StageNode
from bodycam_ros.recording.video_decoder import VideoDecoder

P = TypeVar("P", bound=ImageParameters)

_POLL_S = 0.25
_PATIENCE_S = 2.0
"""A gap without images that is an error; images may arrive slowly from a bag that is played slowly."""

_RECOVERY_S = 5.0
"""All images are used again after so long without one that waited a quarter of the longest wait."""

_BUSY = "images arrive faster than they are processed"
_THINNED = "every second image left out, the machine does not keep up"


@dataclass
class WaitingImage:
    """An image that waits.

    Attributes:
        image: still encoded except for video, of which every frame is needed to decode the next.
        arrival_s: on the steady clock [s].
        restarts: whether time went back before it.
    """

    image: CameraImage
    arrival_s: float
    restarts: bool = False


@dataclass
class ImageTally:
    """Counts since the last report.

    Attributes:
        arrived, images: images that arrived, and that were processed.
        latency_s: from arrival to result, summed [s].
        tracks, keyframes: of a tracker.
        segments: of a region tracker: images in which each segment was observed.
        confidence: of these segments, summed.
    """

    arrived: int = 0
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


class ImageStage(Stage[P]):
    """Processes the images of one camera, from any transport.

    Images wait, up to ``image_queue`` of them, while ``waiting_reason`` has a reason, or ``most_ahead`` frames are
    unanswered. If they wait for too long every second one is left out, undecoded, until the node keeps up again.
    Processing restarts where the time of the images goes back.

    Attributes:
        camera: its name.
        unanswered: frames that the next node has not answered.
        images: that wait, in order of time.
        thinning: decides which images are left out.
        tally: counts since the last report.
        restarts: number of restarts of the camera.
    """

    def __init__(self, node: StageNode[P]) -> None:
        super().__init__(node)
        parameters = self.parameters
        self.camera = self.required("camera")
        self.unanswered = UnansweredFrames(parameters.most_ahead)
        self.thinning = EverySecondImage(parameters.longest_wait, _RECOVERY_S)
        self.tally, self.restarts = ImageTally(), 0
        self.drop_images()

    def subscribe_images(self) -> None:
        """Subscribe to the images; call it after all that processing needs is there."""
        parameters = self.parameters
        self.source = ImageSource(self, self.camera, parameters.transport, parameters.image_queue, self._add_image)
        # The reason to wait may end without another image.
        self.every(_POLL_S, self.process_next)

    def drop_images(self) -> None:
        """Drop the images that wait; the next one has no predecessor."""
        self._decoder = VideoDecoder()
        self._order: StampOrder[WaitingImage] = StampOrder(partial(self._drop, "images out of time"))
        self.images: deque[WaitingImage] = deque()

    @abstractmethod
    def forget(self) -> None:
        """Forget all images so far."""

    def restart(self) -> None:
        """Forget all images so far, and count it in the diagnostics."""
        self.restarts += 1
        self.forget()

    @abstractmethod
    def waiting_reason(self) -> str:
        """Reason why the next image has to wait; empty if there is none."""

    @abstractmethod
    def process(self, image: CameraImage, arrival_s: float) -> None:
        """Process an image that arrived at a time of the steady clock."""

    @abstractmethod
    def processing_since_s(self) -> float:
        """Time on the steady clock from which images wait for nothing but processing."""

    def is_outdated(self) -> bool:
        """Whether the result of the next image would be too late for any use."""
        return False

    def settings_changed(self) -> None:
        """Use the current limits."""
        self.unanswered.most_ahead = self.parameters.most_ahead
        self.thinning.longest_wait_s = self.parameters.longest_wait

    def process_next(self) -> None:
        """Process the next image if there is one that need not wait."""
        if not self.images:
            return
        following = self.images[0]
        if following.restarts:
            following.restarts = False  # once: the image may have to wait here
            self.log.warning(f"camera {self.camera}: the time of its images goes back; restart")
            self.restart()
        if self.is_outdated():
            if self._take(time.monotonic()):
                self._drop("images late", "the solver has continued without one of its images")
        elif self.waiting_reason():
            return
        elif self._take(self.processing_since_s()):
            self.process(following.image, following.arrival_s)
        # One image at a time, so that other messages are handled in between.
        self.call_later(self.process_next)

    def _take(self, since_s: float) -> bool:
        """Take the oldest image; False if it is left out because the machine does not keep up.

        Args:
            since_s: start of the time in which images wait for nothing but processing, on the steady clock.
        """
        taken, now_s = self.images.popleft(), time.monotonic()
        if not self.thinning.leaves_out(taken.image.stamp_ns, now_s - max(taken.arrival_s, since_s), now_s):
            return True
        self._drop("images left out", _THINNED)
        return False

    def _add_image(self, message: Message, transport: str) -> None:
        self.tally.arrived += 1
        now_s, stamp = time.monotonic(), image_stamp_ns(message)
        self.moments.note(Moment.IMAGE_RECEIVED, self.camera, stamp)
        if stamp <= 0:
            self._drop("images without a stamp", f"an image has the stamp {stamp} ns")
            return
        try:
            encoded = TRANSPORTS[transport].convert(message, self.camera)
        except RecordingError as error:
            encoded = CameraImage(self.camera, stamp, error)  # which is raised when it is decoded
        for image in self._decoder.feed(encoded):
            in_order, goes_back = self._order.add(image.stamp_ns, WaitingImage(image, now_s))
            for each in in_order:
                each.restarts = goes_back and each is in_order[0]
                self.images.append(each)
        while len(self.images) > self.parameters.image_queue:
            lost = self.images.popleft()
            self.images[0].restarts |= lost.restarts
            self._drop("images dropped", f"{self.waiting_reason() or _BUSY}; an image is dropped")
        self.call_later(self.process_next)

    def _drop(self, kind: str, reason: str) -> None:
        self.dropped.add(kind, f"camera {self.camera}: {reason}")

    def status(self, values: Mapping[str, object], error: str) -> Status:
        """Status of the camera since the last report.

        Args:
            values: figures of the node.
            error: what is wrong with the results of the images that were processed; empty if nothing is.
        """
        tally, self.tally = self.tally, ImageTally()
        lost = self.dropped.count_new()
        level, text = StatusLevel.OK, "tracking"
        if not tally.images:
            level, text = self._judge_idle(tally.arrived, lost)
        elif error:
            level, text = StatusLevel.ERROR, error
        elif self.thinning.active:
            level, text = StatusLevel.WARN, _THINNED
        elif lost:
            level, text = StatusLevel.WARN, f"tracking, but some input was left out: {self.dropped.latest}"
        figures = {
            "images per second": tally.arrived,
            "tracked per second": tally.images,
            **values,
            "latency [ms]": round(1e3 * tally.latency_s / tally.images, 1) if tally.images else "none",
            "images waiting": len(self.images),
            "restarts": self.restarts,
            **self.dropped.values,
        }
        return Status(f"camera {self.camera}", level, text, figures)

    def _judge_idle(self, arrived: int, lost: int) -> tuple[StatusLevel, str]:
        """Why no image was processed."""
        if self.images:
            return StatusLevel.ERROR, f"no image is tracked: {self.waiting_reason() or _BUSY}"
        if arrived and lost:
            return StatusLevel.ERROR, f"none of the images can be used: {self.dropped.latest}"
        if arrived or self.source.quiet_s < _PATIENCE_S:
            return StatusLevel.OK, "between two images"
        return StatusLevel.ERROR, self.source.explain()
