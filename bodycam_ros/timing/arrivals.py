"""From what cameras and inertial sensors send to frames of the body: what is late, and which epoch it is."""

from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial

from bodycam_ros.body_state import BodyFrame
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.clock_estimator import ClockEstimator
from bodycam_ros.timing.frame_assembler import AssemblerSettings, FrameAssembler
from bodycam_ros.timing.silence import Silence
from bodycam_ros.timing.timeline import Message, Timeline

_RECENT = 150  # frames by which cameras are judged: some seconds
_AT_ONCE_S = 0.005  # stamps of different static cameras that differ by less are one frame


@dataclass(frozen=True)
class CameraArrivals:
    """How one camera's images arrive.

    Attributes:
        share: of the latest frames, of those that the most frequent camera took part in, 0 to 1.
        late: images that came after their frame.
        is_silent: whether it is not waited for.
        apart_s: by how much its stamps are ahead of the latest of all [s], or behind (negative); None if it stopped,
            or sent nothing since the epoch began.
    """

    share: float
    late: int
    is_silent: bool
    apart_s: float | None


class Arrivals:
    """Brings the images of all cameras together to frames of the body, and says when states are due without any.

    What can become of the image that a camera is expected to send for a frame::

        stateDiagram-v2
            [*] --> expected
            expected --> waited_for : another camera has sent its own
            expected --> in_frame : it comes with those of the others
            waited_for --> in_frame : it comes; a free-running camera is interpolated
            waited_for --> given_up : others are ahead by max_wait, the camera is silent
            expected --> given_up : the camera is silent since an earlier frame
            expected --> given_up : all cameras are silent, inertial sensors carry the body (live)
            given_up --> late : it comes after all
            expected --> of_another_time : its stamp is far from those of the other cameras
            of_another_time --> [*] : dropped, unless most cameras follow
            of_another_time --> expected : most cameras follow, an epoch begins with it
            in_frame --> [*] : the frame is closed
            late --> [*] : counted and dropped; paths of free-running cameras use it

    Two words have one meaning each. An image is **late** if its stamp, by the body's time, is not after that of the
    latest frame that left, with images (``FrameAssembler``) or without (``frame_without_images``). An **epoch** ends
    where most cameras go to another time (``Timeline``), as when a bag is played again or a recording paused. What was
    waiting leaves as the last frames of its epoch; clocks are kept, all else begins anew. The first frame of an epoch
    says by ``BodyFrame.is_earlier`` whether time went back to it.

    Args:
        cameras: that are waited for, each from the start, until it is silent.
        settings: how long for, and which stamps belong together.
        live: whether messages come while images are taken, see ``FrameAssembler``.
        clocks: of the body's cameras; stamps of static cameras, and without clocks all, are used as they are.
        on_corrected: called with every registration, its stamp corrected.

    Attributes:
        frames: number of frames so far, of those with images.
    """

    def __init__(
        self,
        cameras: Iterable[str],
        settings: AssemblerSettings | None = None,
        live: bool = False,
        clocks: ClockEstimator | None = None,
        on_corrected: Callable[[LandmarkMatches], None] = lambda matches: None,
    ) -> None:
        settings = settings or AssemblerSettings()
        self._cameras, self._clocks = tuple(cameras), clocks
        self._new_assembler = partial(
            FrameAssembler, self._cameras, live=live, clocks=clocks, on_corrected=on_corrected
        )
        self._settings, self._timeline = settings, Timeline(settings.max_wait)
        self._assembler, self._silence = self._new_assembler(settings), Silence()
        self._recent: deque[frozenset[str]] = deque(maxlen=_RECENT)
        self._late_before: Counter[str] = Counter()  # in earlier epochs
        self._latest_ns = -1  # stamp of the latest frame, in any epoch
        self._is_flushed = True
        self.frames = 0

    @property
    def epoch(self) -> int:
        """How often most cameras went to another time."""
        return self._timeline.epoch

    @property
    def late(self) -> int:
        """Images that came after their frame."""
        return self._late_by_camera.total()

    @property
    def _late_by_camera(self) -> Counter[str]:
        return self._late_before + self._assembler.late

    @property
    def silent(self) -> list[str]:
        """Cameras that are not waited for."""
        return self._assembler.silent

    def cameras(self) -> dict[str, CameraArrivals]:
        """How each camera's images arrive; none before the first frame."""
        counts = Counter(camera for frame in self._recent for camera in frame)
        if not counts:
            return {}
        most = max(counts.values())
        late = self._late_by_camera
        silent = self.silent
        apart_s = self._timeline.apart_s
        return {
            camera: CameraArrivals(counts[camera] / most, late[camera], camera in silent, apart_s(camera))
            for camera in self._cameras
        }

    def set_max_wait(self, seconds: float) -> None:
        """Replace ``max_wait`` of the settings [s]."""
        self._settings = replace(self._settings, max_wait=seconds)
        self._timeline.set_max_wait(seconds)
        self._assembler.max_wait_ns = round(1e9 * seconds)

    def add(self, message: Message) -> list[BodyFrame]:
        """Add a registration, or an image of a static camera; frames that are complete now, in order of time."""
        frames, epoch = list[BodyFrame](), self.epoch
        for each in self._timeline.admit(message):
            if self.epoch > epoch:
                epoch = self.epoch
                frames += self._end_epoch()
            self._silence.add_message(each.stamp_ns)
            self._is_flushed = False
            frames += self._counted(self._assembler.add(each))
        return frames

    def add_image(self, stamp_ns: int) -> None:
        """Note that an image was taken [ns], whose registration is still to come; live, it is waited for."""
        self._silence.add_image(stamp_ns)

    def add_sample(self, stamp_ns: int, period_ns: float) -> float | None:
        """Add an inertial sample as it comes, its stamp in the body's time [ns].

        Args:
            stamp_ns: of the sample.
            period_ns: of the states [ns]; infinite before it is known.

        Returns:
            Time up to which states are due without images, after what ``flush`` gives [ns]; None while there are
            images.
        """
        self._silence.add_sample(stamp_ns)
        return self._silence.due_ns(period_ns)

    @property
    def latest_message_ns(self) -> int:
        """Latest stamp of a message in this epoch [ns]; -1 before the first."""
        return self._silence.message_ns

    def frame_without_images(self, stamp_ns: int) -> BodyFrame:
        """The frame at a stamp [ns] that is solved without images; those that come up to it are late."""
        self._assembler.close(stamp_ns)
        self._latest_ns = stamp_ns
        return BodyFrame(stamp_ns, {})

    def complete(self) -> list[BodyFrame]:
        """Frames that are complete by now, because a camera has been silent for long enough."""
        return self._counted(self._assembler.complete())

    def flush(self) -> list[BodyFrame]:
        """Frames that were still waiting for a camera: the recording is over, or all cameras are silent."""
        if self._is_flushed:
            return []
        self._is_flushed = True
        return self._counted(self._assembler.flush())

    def _end_epoch(self) -> list[BodyFrame]:
        """What is left of an epoch; the time of the next one may be earlier."""
        frames = self.flush()
        if self._clocks:
            self._clocks.restart()
        self._late_before += self._assembler.late
        self._assembler, self._silence = self._new_assembler(self._settings), Silence()
        return frames

    def _counted(self, frames: Iterable[BodyFrame]) -> list[BodyFrame]:
        """Frames with images on their way out."""
        passed = []
        for frame in frames:
            passed.append(replace(frame, is_earlier=frame.stamp_ns <= self._latest_ns))
            self._latest_ns = frame.stamp_ns
            self.frames += 1
            self._recent.append(frozenset({*frame.matches, *frame.images}))
        return passed


def frames_at_once(images: Iterable[CameraImage], cameras: Collection[str]) -> Iterator[BodyFrame]:
    """Images of static cameras that are of one time, in order of time."""
    arrivals = Arrivals(cameras, AssemblerSettings(sync_tolerance=_AT_ONCE_S))
    for image in images:
        yield from arrivals.add(image)
    yield from arrivals.flush()
