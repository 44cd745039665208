"""Part that the tracker and the region tracker share: one camera's images, processed one at a time."""

import time
from abc import abstractmethod
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeVar

from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.live.image_queue import THINNED, ImageQueue, QueuedImage
from bodycam_ros.live.node_parameters import ImageParameters
from bodycam_ros.live.stamp_order import Ordered
from bodycam_ros.live.unanswered_frames import UnansweredFrames
from bodycam_ros.messages.diagnostics import Status, StatusLevel
from bodycam_ros.nodes.camera_topics import ImageSource
from bodycam_ros.nodes.stage_node import Stage, StageNode

P = TypeVar("P", bound=ImageParameters)

_POLL_S = 0.25
_PATIENCE_S = 2.0
"""A gap without images that is an error; images may arrive slowly from a bag that is played slowly."""

_BUSY = "images arrive faster than they are processed"


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


class ImageStage(Stage[P]):
    """Processes the images of one camera.

    Images wait, up to ``image_queue`` of them, while ``waiting_reason`` has a reason, or ``most_ahead`` frames are
    unanswered. If they wait for too long every second one is left out, undecoded, until the node keeps up again.
    Processing restarts where the time of the images goes back.

    Attributes:
        camera: its name.
        unanswered: frames that the next node has not answered.
        images: that wait.
        tally: counts since the last report.
        restarts: number of restarts of the camera.
    """

    def __init__(self, node: StageNode[P]) -> None:
        super().__init__(node)
        parameters = self.parameters
        self.camera = self.required("camera")
        self.unanswered = UnansweredFrames(parameters.most_ahead)
        self.images = ImageQueue(
            self.camera,
            self.dropped,
            self.moments,
            parameters.image_queue,
            parameters.longest_wait,
            lambda: self.call_later(self.process_next),
            lambda: self.waiting_reason() or _BUSY,
        )
        self.tally, self.restarts = ImageTally(), 0
        self._restarted_at: Ordered[QueuedImage] | None = None

    def subscribe_images(self) -> None:
        """Subscribe to the images; call it after all that processing needs is there."""
        parameters = self.parameters
        self.source = ImageSource(self, self.camera, parameters.transport, parameters.image_queue, self.images.add)
        # The reason to wait may end without another image.
        self.every(_POLL_S, self._poll)

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
        self.images.thinning.longest_wait_s = self.parameters.longest_wait

    def process_next(self) -> None:
        """Process the next image if there is one that need not wait."""
        if not len(self.images):
            return
        following = self.images.oldest
        if following.restarts and following is not self._restarted_at:
            # Once: the image may have to wait here.
            self._restarted_at = following
            self.log.warning(f"camera {self.camera}: the time of its images goes back; restart")
            self.restart()
        if self.is_outdated():
            if self.images.take(time.monotonic()) is not None:
                reason = f"camera {self.camera}: the solver has continued without one of its images"
                self.dropped.add("images late", reason)
        elif self.waiting_reason():
            return
        elif (image := self.images.take(self.processing_since_s())) is not None:
            self.process(image, following.item.arrival_s)
        # One image at a time, so that other messages are handled in between.
        self.call_later(self.process_next)

    def status(self, values: Mapping[str, object], error: str) -> Status:
        """Status of the camera since the last report.

        Args:
            values: figures of the node.
            error: what is wrong with the results of the images that were processed; empty if nothing is.
        """
        tally, self.tally = self.tally, ImageTally()
        arrived, self.images.arrived = self.images.arrived, 0
        lost = self.dropped.count_new()
        level, text = StatusLevel.OK, "tracking"
        if not tally.images:
            level, text = self._judge_idle(arrived, lost)
        elif error:
            level, text = StatusLevel.ERROR, error
        elif self.images.thinning.active:
            level, text = StatusLevel.WARN, THINNED
        elif lost:
            level, text = StatusLevel.WARN, f"tracking, but some input was left out: {self.dropped.latest}"
        figures = {
            "images per second": arrived,
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
        if len(self.images):
            return StatusLevel.ERROR, f"no image is tracked: {self.waiting_reason() or _BUSY}"
        if arrived and lost:
            return StatusLevel.ERROR, f"none of the images can be used: {self.dropped.latest}"
        if arrived or self.source.quiet_s < _PATIENCE_S:
            return StatusLevel.OK, "between two images"
        return StatusLevel.ERROR, self.source.explain()

    def _poll(self) -> None:
        self.images.poll()
        self.process_next()
