"""Images of one camera on their way into a stage, the tracker or the solver: in order, one at a time."""

import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from statistics import median
from typing import Any

from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.diagnostics.camera_diagnostics import FEW_IMAGES
from bodycam_ros.diagnostics.dropped_messages import DroppedMessages
from bodycam_ros.errors import BodycamError, RecordingError, SettingsError
from bodycam_ros.graph.every_second_image import EverySecondImage
from bodycam_ros.messages.diagnostics import Status, StatusLevel
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.images import TRANSPORTS, Transport, image_stamp_ns
from bodycam_ros.nodes.camera_topics import DriverTopic, TopicForm
from bodycam_ros.nodes.moments import Moment
from bodycam_ros.nodes.stage_node import Stage
from bodycam_ros.recording.video_decoder import VideoDecoder
from bodycam_ros.timing.timeline import Timeline

_POLL_S = 0.25
_PATIENCE_S = 2.0
"""A gap without images that is an error; images may arrive slowly from a bag that is played slowly."""

_RECOVERY_S = 5.0
"""All images are used again after so long without one that waited for too long."""

_LONGEST_GAP_S = 2.0
"""Beyond five times this a stamp does not follow the one before; a stray stamp may, and the next tells."""

_PERIODS = 60
"""Reports, of a second each, whose shortest period of images is a camera's usual one."""

_BUSY = "images arrive faster than they are processed"
_THINNED = "every second image dropped, the machine does not keep up"


@dataclass
class WaitingImage:
    """An image that waits.

    Attributes:
        image: still encoded except for video, of which every frame is needed to decode the next.
        arrival_s: on the steady clock [s].
        restarts: whether time jumped before it.
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
        stamps_ns: of those that arrived [ns].
    """

    arrived: int = 0
    images: int = 0
    latency_s: float = 0.0
    stamps_ns: list[int] = field(default_factory=list)

    def mean(self, total: float) -> float:
        """Mean of a total over the images."""
        return round(total / max(1, self.images), 1)


class CameraImages:
    """Images of one camera, from any transport, in order, processed one at a time.

    Images wait, up to ``image_queue`` of them, while there is a reason. If they wait for too long every second one is
    left out, undecoded, until the node keeps up again.

    Args:
        stage: processes the images; its parameters have their limits.
        camera: its name.
        dropped: counts images that could not be used.
        process: called with each image; whether it has a result.
        waiting_reason: why the next image has to wait; empty if there is none.
        restart: called where the time of the images jumps, as when a bag is played again.
        ready_since_s: time on the steady clock from which images wait for nothing but processing.

    Attributes:
        tally: counts since the last report.
        restarts: number of restarts of the camera.

    Raises:
        SettingsError: there is no such transport.
    """

    def __init__(
        self,
        stage: Stage[Any],
        camera: str,
        dropped: DroppedMessages,
        process: Callable[[CameraImage], bool],
        waiting_reason: Callable[[], str] = lambda: "",
        restart: Callable[[], None] = lambda: None,
        ready_since_s: Callable[[], float] = lambda: 0.0,
    ) -> None:
        self._stage = stage
        self._camera = camera
        self._dropped = dropped
        self._process = process
        self._waiting_reason = waiting_reason
        self._restart = restart
        self._ready_since_s = ready_since_s
        if (transport := stage.parameters.transport) not in TRANSPORTS:
            known = ", ".join(TRANSPORTS)
            raise SettingsError(f"the parameter 'transport' must be one of {known}, not '{transport}'")
        self._thinning = EverySecondImage(_RECOVERY_S)
        self.tally, self.restarts = ImageTally(), 0
        self._periods_ns: deque[float] = deque(maxlen=_PERIODS)
        self.drop()
        forms = {
            name: TopicForm(of.kind, f"{camera}{of.ending}", partial(self._add, of)) for name, of in TRANSPORTS.items()
        }
        preferred = [forms.pop(transport), *forms.values()]
        self._source = DriverTopic(stage, preferred, stage.parameters.image_queue, overridable=True)
        # The reason to wait may end without another image.
        stage.every(_POLL_S, self.process_next)

    def drop(self) -> None:
        """Drop the images that wait; the next one has no predecessor."""
        self._decoder = VideoDecoder()
        self._timeline, self._doubtful_ns = Timeline(_LONGEST_GAP_S), 0
        self._images: deque[WaitingImage] = deque()

    def restart(self) -> None:
        """Forget all images so far, and count it in the diagnostics."""
        self.restarts += 1
        self._restart()

    def process_next(self) -> None:
        """Process the next image if there is one that need not wait."""
        if not self._images:
            return
        following = self._images[0]
        if following.restarts:
            following.restarts = False  # once: the image may have to wait here
            self._stage.log.warning(f"camera {self._camera}: the time of its images jumps; restart")
            self.restart()
        if self._waiting_reason():
            return
        try:
            if self._take(self._ready_since_s()) and self._process(following.image):
                self.tally.images += 1
                self.tally.latency_s += time.monotonic() - following.arrival_s
        except BodycamError as error:
            self._count_drop("images unusable", str(error))
        # One image at a time, so that other messages are handled in between.
        self._stage.call_later(self.process_next)

    def _take(self, since_s: float) -> bool:
        """Take the oldest image; False if it is left out because the machine does not keep up.

        Args:
            since_s: start of the time in which images wait for nothing but processing, on the steady clock.
        """
        taken, now_s = self._images.popleft(), time.monotonic()
        is_late = 0.0 < self._stage.parameters.longest_wait < now_s - max(taken.arrival_s, since_s)
        if not self._thinning.leaves_out(taken.image.stamp_ns, is_late, now_s):
            return True
        self._count_drop("images thinned out", _THINNED)
        return False

    def _add(self, transport: Transport, message: Message) -> None:
        self.tally.arrived += 1
        now_s, stamp = time.monotonic(), image_stamp_ns(message)
        self._stage.moments.note(Moment.IMAGE_RECEIVED, self._camera, stamp)
        if stamp <= 0:
            self._count_drop("images without a stamp", f"an image has the stamp {stamp} ns")
            return
        self.tally.stamps_ns.append(stamp)
        try:
            encoded = transport.convert(message, self._camera)
        except RecordingError as error:
            encoded = CameraImage(self._camera, stamp, error)  # which is raised when it is decoded
        for image in self._decoder.feed(encoded):
            self._put_in_order(image, now_s)
        while len(self._images) > self._stage.parameters.image_queue:
            lost = self._images.popleft()
            self._images[0].restarts |= lost.restarts
            self._count_drop("images dropped", f"{self._waiting_reason() or _BUSY}; an image is dropped")
        self._stage.call_later(self.process_next)

    def _put_in_order(self, image: CameraImage, now_s: float) -> None:
        """Let an image wait, unless its stamp does not follow: then the next one decides whether it is a stray."""
        epoch = self._timeline.epoch
        admitted = self._timeline.admit(image)
        if self._doubtful_ns and all(each.stamp_ns != self._doubtful_ns for each in admitted):
            reason = f"stamp {self._doubtful_ns} ns does not follow, and the stream does not continue there"
            self._count_drop("images out of time", reason)
        self._doubtful_ns = 0 if admitted else image.stamp_ns
        for each in admitted:
            assert isinstance(each, CameraImage)
            self._images.append(WaitingImage(each, now_s, restarts=self._timeline.epoch > epoch))
            epoch = self._timeline.epoch

    def _count_drop(self, kind: str, reason: str) -> None:
        self._dropped.add(kind, f"camera {self._camera}: {reason}")

    def status(self, values: Mapping[str, object], error: str) -> Status:
        """Status of the camera since the last report.

        Args:
            values: figures of the node.
            error: what is wrong with the results of the images that were processed; empty if nothing is.
        """
        tally, self.tally = self.tally, ImageTally()
        period_ns, usual_ns = self._period_ns(tally)
        lost = self._dropped.count_new()
        level, text = StatusLevel.OK, "tracking"
        if not tally.images:
            level, text = self._judge_idle(tally.arrived, lost)
        elif error:
            level, text = StatusLevel.ERROR, error
        elif self._thinning.active:
            level, text = StatusLevel.WARN, _THINNED
        elif period_ns * FEW_IMAGES > usual_ns:
            rates = f"{1e9 / period_ns:.0f} images a second, and had {1e9 / usual_ns:.0f} before"
            level, text = StatusLevel.WARN, f"tracking, but the camera has {rates}"
        elif lost:
            level, text = StatusLevel.WARN, f"tracking, but some input was dropped: {self._dropped.latest}"
        figures = {
            "images per second": tally.arrived,
            "tracked per second": tally.images,
            **values,
            "latency [ms]": round(1e3 * tally.latency_s / tally.images, 1) if tally.images else "none",
            "images waiting": len(self._images),
            "restarts": self.restarts,
            **self._dropped.values,
        }
        return Status(f"camera {self._camera}", level, text, figures)

    def _period_ns(self, tally: ImageTally) -> tuple[float, float]:
        """Median period of the images of a report by their stamps, and the usual one [ns]; of none both are 0."""
        steps = [after - before for before, after in pairwise(tally.stamps_ns) if after > before]
        if not steps:
            return 0.0, 0.0
        period_ns = float(median(steps))
        self._periods_ns.append(period_ns)
        return period_ns, min(self._periods_ns)

    def _judge_idle(self, arrived: int, lost: int) -> tuple[StatusLevel, str]:
        """Why no image was processed."""
        if self._images:
            return StatusLevel.ERROR, f"no image is tracked: {self._waiting_reason() or _BUSY}"
        if arrived and lost:
            return StatusLevel.ERROR, f"none of the images can be used: {self._dropped.latest}"
        if arrived or self._source.quiet_s < _PATIENCE_S:
            return StatusLevel.OK, "between two images"
        return StatusLevel.ERROR, self._source.explain("image")
