"""Part that the tracker and the region tracker share: one camera's images, processed one at a time."""

import time
from abc import abstractmethod
from typing import TypeVar

from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.live.image_diagnostics import ImageDiagnostics, MissingInput
from bodycam_ros.live.image_queue import ImageQueue, QueuedImage
from bodycam_ros.live.node_parameters import ImageParameters
from bodycam_ros.live.stamp_order import Ordered
from bodycam_ros.live.unanswered_frames import UnansweredFrames
from bodycam_ros.nodes.camera_topics import ImageSource
from bodycam_ros.nodes.stage_node import Stage, StageNode

P = TypeVar("P", bound=ImageParameters)

_POLL_S = 0.25
_BUSY = "images arrive faster than they are processed"


class ImageStage(Stage[P]):
    """Processes the images of one camera.

    Images wait, up to ``image_queue`` of them, while ``waiting_reason`` has a reason, or ``most_ahead`` frames are
    unanswered. If they wait for too long every second one is left out, undecoded, until the node keeps up again.
    Processing restarts where the time of the images goes back.

    Attributes:
        camera: its name.
        unanswered: frames that the next node has not answered.
        images: that wait.
        diagnostics: counts of images.
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
        self.diagnostics = ImageDiagnostics(self.camera, self.images, self.dropped)
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
        self.diagnostics.restarts += 1
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

    def missing_input(self) -> MissingInput:
        """Why images are not processed."""
        waiting = self.waiting_reason() if len(self.images) else ""
        return MissingInput(self.source.quiet_s, self.source.explain(), waiting or _BUSY)

    def _poll(self) -> None:
        self.images.poll()
        self.process_next()
