"""The cameras of a recording: their intrinsics, and their images in time order."""

import logging
import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import cached_property
from itertools import chain, groupby, islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, check_image_size
from bodycam_ros.camera.readout import Readout
from bodycam_ros.errors import LensError, RecordingError
from bodycam_ros.files.shown import few, other_than
from bodycam_ros.messages.images import INFO, INFO_TYPE, TRANSPORTS, camera_model, image_stamp_ns
from bodycam_ros.messages.timing import TIMING, TIMING_TYPE, readout_time
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.imu_reader import sensor_topics
from bodycam_ros.recording.keyframes import LATE_NS, images_at, key_before, keyframe_samples
from bodycam_ros.recording.topic_names import AS_RECORDED, TopicNames
from bodycam_ros.recording.video_decoder import VideoDecoder

logger = logging.getLogger(__name__)

_END_NS = 1_000_000_000
"""How far back from the end of a bag the last images are searched for first."""

LAST_NS = 2**63 - 1
"""Time of recording of what comes after the last message."""

WHOLE_NS = 0, LAST_NS
"""A window of all stamps [ns]."""

_TRIED_INFOS = 30  # messages, of which one may be usable: a second of them

_CONVERTERS = {each.ending: each.convert for each in TRANSPORTS.values()}


@contextmanager
def open_recording(path: Path, names: TopicNames = AS_RECORDED) -> Iterator["Recording"]:
    """Open a ros2 bag folder or an .mcap file with cameras, whose topics may have other names.

    Opening takes some 50 ms and loads no image: worker processes open the recording themselves, each for its camera.

    Raises:
        RecordingError: nothing there, not a bag, damaged, of another system than ROS 2, or without a camera.
    """
    with BagFile(path, names) as bag:
        yield Recording(bag)


class Recording:
    """Images and intrinsics by camera.

    A camera is a pair of topics ``/<camera>/image_raw/compressed`` (or ``/<camera>/image_raw``, or a video on
    ``/<camera>/image_raw/compressed_video``) and ``/<camera>/camera_info``.

    Attributes:
        path: where the recording is.
        names: how its topics are named here.
        cameras: names in alphabetical order.
        dropped: camera -> images that the last iteration left out because their stamp did not increase.
        lost: camera -> images by the bag's count that the last iteration did not find: the file is damaged.
    """

    def __init__(self, bag: BagFile) -> None:
        self.path, self.names = bag.path, bag.names
        self.dropped: Counter[str] = Counter()
        self.lost: Counter[str] = Counter()
        self._bag = bag
        self._image_topic: dict[str, str] = {}
        self._lenses: dict[str, CameraModel | None] = {}
        for transport in TRANSPORTS.values():
            for topic, camera in bag.camera_topics(transport.ending, transport.kind).items():
                self._image_topic.setdefault(camera, topic)
        self.cameras = tuple(sorted(self._image_topic))
        if not self.cameras:
            there = few((f"{topic} ({kind})" for topic, kind in bag.topics.items()), 8) or "none at all"
            solved = "; it is the solved bag of a recording: give the recording" if "/skeleton" in bag.topics else ""
            raise RecordingError(
                f"{bag.path}: no camera; expected topics /<camera>/image_raw/compressed, /<camera>/image_raw or "
                f"/<camera>/image_raw/compressed_video, there are: {there}{solved}"
            )

    @property
    def start_ns(self) -> int:
        """When the first message was recorded [ns]."""
        return self._bag.start_ns

    @property
    def has_sensors(self) -> bool:
        """Whether an inertial sensor of a camera is in the bag."""
        return bool(sensor_topics(self._bag, self.cameras, required=False))

    @property
    def first_stamp_ns(self) -> int:
        """Stamp of the first image in the bag that has one, of whatever camera [ns]; 0 if none has."""
        return 0 if self._first is None else self._first.stamp_ns

    @cached_property
    def _first(self) -> CameraImage | None:
        return next((image for image in self._messages(self.cameras) if image.stamp_ns > 0), None)

    @property
    def duration_s(self) -> float:
        """From the first recorded message to the last [s]."""
        return self._bag.duration_s

    @property
    def damage(self) -> str:
        """What was found wrong with the bag so far, and up to which time it is read; empty if nothing was."""
        return self._bag.damage

    def image_count(self, camera: str) -> int:
        """Images of a camera by the bag's count, those with bad stamps and missing ones included."""
        return self._bag.message_count(self._topic_of(camera))

    def camera_model(self, camera: str) -> CameraModel:
        """The camera's intrinsics, from its first CameraInfo that can be used; a damaged one costs no camera.

        Raises:
            LensError: there is none, all are malformed, or their distortion model is unknown.
        """
        self._topic_of(camera)
        topic = f"/{camera}{INFO}"
        if self._bag.topics.get(topic, INFO_TYPE) != INFO_TYPE:
            raise LensError(f"{topic} in {self.path} is {self._bag.topics[topic]}, not {INFO_TYPE}", camera)
        first: LensError | None = None
        for _, _, message in islice(self._bag.messages([topic]), _TRIED_INFOS):
            try:
                return camera_model(message, camera)
            except LensError as error:
                first = first or error
        if first is not None:
            raise first
        if count := self._bag.message_count(topic):
            raise LensError(
                f"none of {count} messages on {topic} in {self.path} can be read: they are damaged, "
                f"or of another definition of {INFO_TYPE}; copy the recording again",
                camera,
            )
        raise LensError(f"{self.path} has no message on {topic}; record it along with the images", camera)

    def readout(self, camera: str) -> Readout | None:
        """Read-out time of the camera, first on ``/<camera>/timing``; None if it is not there.

        Raises:
            RecordingError: a value is impossible.
        """
        self._topic_of(camera)
        topic = f"/{camera}{TIMING}"
        if self._bag.topics.get(topic) != TIMING_TYPE:
            return None
        for _, _, message in self._bag.messages([topic]):
            try:
                return readout_time(message)
            except ValueError as error:
                raise RecordingError(f"{topic} in {self.path} has {error}", camera) from error
        return None

    def clock_sigma(self, camera: str) -> float:
        """Standard deviation of the camera's clock offset as an ingest found it [s]; 0 where none is recorded."""
        topic = f"/{camera}{TIMING}"
        if self._bag.topics.get(topic) != TIMING_TYPE:
            return 0.0
        sigma = next((float(message.offset_sigma) for _, _, message in self._bag.messages([topic])), 0.0)
        return sigma if 0.0 <= sigma < math.inf else 0.0

    def images(
        self,
        cameras: Collection[str] | None = None,
        window_ns: tuple[int, int] = WHOLE_NS,
        recorded_ahead_ns: int | None = None,
    ) -> Iterator[CameraImage]:
        """Yield the images of some cameras (all by default) in the order in which they were recorded.

        ``window_ns`` are the first stamp of those that are wanted, and the stamp after the last [ns].
        Images recorded at one time are in the order of their cameras' names, so that images of some cameras are in
        the same order as among those of all. ``recorded_ns`` never decreases.
        Within a camera stamps increase strictly: an image whose stamp does not is left out, counted in ``dropped``, and
        the first of them warned about, and so is one of before 1970. ``lost`` counts missing ones once all are read.
        Every frame of a video is decoded, wanted or not: the next one is made of it.
        With ``recorded_ahead_ns``, by how much images are recorded after their stamps, the bag is read near the window
        alone, from the keyframes of videos before it on; ``lost`` stays empty.
        """
        wanted = self.cameras if cameras is None else cameras
        start_ns = stop_ns = None
        if recorded_ahead_ns is not None:
            start_ns = key_before(self._messages, self.start_ns, wanted, window_ns[0] + recorded_ahead_ns - LATE_NS)
            stop_ns = min(window_ns[1] + recorded_ahead_ns + LATE_NS, LAST_NS)
        for camera in wanted:
            self.dropped[camera] = self.lost[camera] = 0
        decoders = {camera: VideoDecoder() for camera in wanted}
        decoded = (
            replace(ready, recorded_ns=image.recorded_ns)
            for image in _in_order_of_names(self._messages(wanted, start_ns, stop_ns))
            for ready in decoders[image.camera].feed(image)
        )
        last = (
            replace(image, recorded_ns=stop_ns or LAST_NS)
            for camera in sorted(decoders)
            for image in decoders[camera].flush()
        )
        for image in self._increasing(chain(decoded, last)):
            if window_ns[0] <= image.stamp_ns < window_ns[1]:
                yield image

    @property
    def recorded_ahead_ns(self) -> int:
        """Delay from the stamp of the first image that has one to its time of recording [ns]."""
        return 0 if self._first is None else self._first.recorded_ns - self._first.stamp_ns

    def images_at(self, rows: Mapping[str, tuple[int, int]]) -> dict[str, CameraImage]:
        """Camera -> one image of it, of a video decoded from the keyframe before it on; those that are there.

        Args:
            rows: camera -> when the image was recorded, and its stamp [ns], as of ``image_times``.
        """
        return images_at(self._messages, self.start_ns, rows)

    def keyframe_samples(self, most: int) -> dict[str, dict[int, CameraImage]]:
        """Camera -> number -> image decoded from keyframes, of cameras that record videos; others are left out.

        Numbers are those of ``keyframes.keyframe_samples``.
        """
        length_ns = max(round(1e9 * self.duration_s), 1)
        return keyframe_samples(self._messages(self.cameras), self.start_ns, length_ns, most)

    def camera_spans(self, cameras: Collection[str]) -> dict[str, tuple[int, int]]:
        """Camera -> stamps of its first and last image in the bag [ns]; those that have images with a stamp."""
        topics = {self._topic_of(camera): camera for camera in cameras}
        firsts: dict[str, int] = {}
        for topic, _, stamp_ns in self._bag.header_stamps(topics):
            if stamp_ns > 0:
                firsts.setdefault(topics[topic], stamp_ns)
            if len(firsts) == len(topics):
                break
        lasts: dict[str, int] = {}
        end_ns, before_ns = self.start_ns + round(1e9 * self.duration_s), _END_NS
        while len(lasts) < len(firsts):
            since_ns = max(end_ns - before_ns, self.start_ns)
            try:
                for topic, _, stamp_ns in self._bag.header_stamps(topics, since_ns):
                    if topics[topic] in firsts:
                        lasts[topics[topic]] = max(stamp_ns, lasts.get(topics[topic], firsts[topics[topic]]))
            except RecordingError:
                # Damage before all that is read here: from the start on it is read up to the damage.
                if since_ns == self.start_ns:
                    raise
                before_ns = end_ns - self.start_ns
                continue
            if since_ns == self.start_ns:
                break
            before_ns *= 4
        return {camera: (first, lasts.get(camera, first)) for camera, first in firsts.items()}

    def image_times(self) -> dict[str, NDArray[np.int64]]:
        """Camera -> (N, 2) when its images were recorded, and their stamps [ns], in order of the former."""
        cameras = {topic: camera for camera, topic in self._image_topic.items()}
        times: dict[str, list[tuple[int, int]]] = {camera: [] for camera in self.cameras}
        for topic, recorded_ns, stamp_ns in self._bag.header_stamps(cameras):
            times[cameras[topic]].append((recorded_ns, stamp_ns))
        return {camera: np.array(rows, np.int64).reshape(-1, 2) for camera, rows in times.items()}

    def image_stamps(self, cameras: Collection[str]) -> dict[str, NDArray[np.int64]]:
        """Camera -> (N,) stamps of its images [ns], in their order."""
        times = self.image_times()
        return {camera: np.sort(times[camera][:, 1]) for camera in cameras}

    def _messages(
        self, cameras: Collection[str], start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[CameraImage]:
        """The images of some cameras as they are in the bag; between two times, if they are given."""
        source = {self._topic_of(camera): camera for camera in cameras}
        lenses = {camera: self._lens(camera) for camera in cameras}
        found: Counter[str] = Counter()
        for topic, recorded_ns, message in self._bag.messages(source, start_ns, stop_ns):
            camera = source[topic]
            found[camera] += 1
            convert = _CONVERTERS[topic.removeprefix(f"/{camera}")]
            try:
                image = convert(message, camera)
                if (lens := lenses[camera]) is not None:
                    check_image_size(image, lens)
            except RecordingError as error:
                # One bad image must not cost the others: it is refused where it is decoded.
                image = CameraImage(camera, image_stamp_ns(message), error)
            yield replace(image, recorded_ns=recorded_ns)
        for camera in cameras if start_ns is None else ():
            self.lost[camera] = max(0, self.image_count(camera) - found[camera])

    def _increasing(self, images: Iterable[CameraImage]) -> Iterator[CameraImage]:
        latest: dict[str, int] = {}
        for image in images:
            latest_ns = latest.get(image.camera, -1)
            if image.stamp_ns <= latest_ns:
                self._drop(image, max(0, latest_ns))
                continue
            latest[image.camera] = image.stamp_ns
            yield image

    def _drop(self, image: CameraImage, latest_ns: int) -> None:
        self.dropped[image.camera] += 1
        if self.dropped.total() > 1:
            return
        if image.stamp_ns < 0:
            logger.warning(
                "camera %s: the stamp of an image is %d ns, before 1970; such images are dropped, of all cameras",
                image.camera,
                image.stamp_ns,
            )
        else:
            logger.warning(
                "camera %s: stamp %d ns follows %d ns; images whose stamp does not increase are dropped, of all "
                "cameras",
                image.camera,
                image.stamp_ns,
                latest_ns,
            )

    def _lens(self, camera: str) -> CameraModel | None:
        """The camera's intrinsics, by which the size of its images is checked; None where it has none."""
        if camera not in self._lenses:
            self._lenses[camera] = None
            with suppress(LensError):
                self._lenses[camera] = self.camera_model(camera)
        return self._lenses[camera]

    def _topic_of(self, camera: str) -> str:
        if camera not in self._image_topic:
            raise RecordingError(f"{self.path}: no camera '{camera}'; {other_than(camera, self.cameras)}")
        return self._image_topic[camera]


def _in_order_of_names(images: Iterable[CameraImage]) -> Iterator[CameraImage]:
    """Images in order of their recording; of one time in order of their cameras' names."""
    for _, together in groupby(images, key=lambda image: image.recorded_ns):
        yield from sorted(together, key=lambda image: image.camera)
