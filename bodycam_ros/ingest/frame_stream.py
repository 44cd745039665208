"""The messages of one camera in order of time, as they go into the bag."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from bodycam_ros.camera.readout import Readout
from bodycam_ros.errors import RecordingError
from bodycam_ros.ingest.camera_time import CameraTime
from bodycam_ros.ingest.ingest_camera import IngestCamera
from bodycam_ros.messages.camera_info import camera_info_message
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.header import header_message, optical_frame, time_message
from bodycam_ros.messages.timing import SaidTiming, timing_message
from bodycam_ros.recording.typestore import COMPRESSED_VIDEO, recorded_messages, recording_typestore
from bodycam_ros.video.upright_frames import h264_packets, jpegs
from bodycam_ros.video.video_file import TimedPacket

_INFO_EVERY_NS = 1_000_000_000
"""A reader that begins in the middle of a bag needs not wait for the lens."""

_ASTRAY_S = 60.0
"""A frame so far from the time of its file has a damaged time."""

_LONGEST_S = 1e6

_FORMATS = {"h264": "h264", "hevc": "h265"}


@dataclass(frozen=True)
class StampedMessage:
    """A message ready to be written: stamp [ns], topic, type and CDR bytes."""

    stamp_ns: int
    topic: str
    message_type: str
    cdr: bytes


@dataclass
class StreamTally:
    """What became of a camera's frames, while they are read.

    Attributes:
        frames: in the bag.
        first_ns, last_ns: their stamps [ns].
        without_key: that came before the first keyframe and cannot be decoded.
        unordered: whose time is not after the one before, or out of all reason.
        fault: why the camera ended early, if it did.
    """

    frames: int = 0
    first_ns: int = 0
    last_ns: int = 0
    without_key: int = 0
    unordered: int = 0
    fault: str = ""


@dataclass
class FrameStream:
    """One camera on its way into the bag.

    Attributes:
        camera: what is read.
        time: where its media time lies in the recording.
        base_ns: stamp of the recording's time 0 [ns].
        as_jpeg: write still images.
        threads: that decode and compress.
        tally: what became of the frames so far.
    """

    camera: IngestCamera
    time: CameraTime
    base_ns: int
    as_jpeg: bool
    threads: int
    tally: StreamTally = field(default_factory=StreamTally)

    @property
    def is_copied(self) -> bool:
        """Whether the frames go into the bag as the camera compressed them."""
        return not self.as_jpeg and self.camera.video.facts.is_upright_annex_b

    def messages(self) -> Iterator[StampedMessage]:
        """Lens and timing first, then the frames; the lens once a second.

        What cannot be read or compressed ends the camera early, and is noted: the others go on.
        """
        try:
            yield from self._stamped_frames()
        except RecordingError as error:
            self.tally.fault = str(error)

    def _stamped_frames(self) -> Iterator[StampedMessage]:
        make, name = recorded_messages(), self.camera.name
        info_due_ns: int | None = None
        latest_s = (self.camera.video.duration_s or math.inf) + _ASTRAY_S
        for media_s, topic, message in self._frames():
            if not -_ASTRAY_S < media_s < min(latest_s, _LONGEST_S):
                self.tally.unordered += 1
                continue
            stamp_ns = self.base_ns + round(1e9 * float(self.time.recording_s(np.array([media_s]))[0]))
            if self.tally.frames and stamp_ns <= self.tally.last_ns:
                self.tally.unordered += 1
                continue
            if info_due_ns is None:
                self.tally.first_ns = info_due_ns = stamp_ns
                yield _stamped(stamp_ns, f"/{name}/timing", self._timing(stamp_ns))
            if stamp_ns >= info_due_ns:
                info_due_ns += _INFO_EVERY_NS
                yield _stamped(stamp_ns, f"/{name}/camera_info", camera_info_message(make, self.camera.lens, stamp_ns))
            self.tally.frames += 1
            self.tally.last_ns = stamp_ns
            if self.as_jpeg:
                message.header = header_message(make, stamp_ns, optical_frame(name))
            else:
                message.timestamp = time_message(make, stamp_ns)
            yield _stamped(stamp_ns, topic, message)

    def _timing(self, stamp_ns: int) -> Message:
        time = self.time
        readout = None if self.camera.readout_s is None else Readout(self.camera.readout_s, 0.0)
        said = SaidTiming(stamp_ns, time.source, readout, offset_sigma=time.start_sigma_s, drift_sigma=time.drift_sigma)
        return timing_message(recorded_messages(), self.camera.name, said)

    def _frames(self) -> Iterator[tuple[float, str, Message]]:
        """Media time [s], topic, and message without a stamp."""
        make, name = recorded_messages(), self.camera.name
        if self.as_jpeg:
            facts = self.camera.video.facts
            for media_s, file in jpegs(self.camera.video.frames(self.threads), facts.rotation_deg):
                data = np.frombuffer(file, dtype=np.uint8)
                image = make("sensor_msgs/msg/CompressedImage", format="jpeg", data=data)
                yield media_s, f"/{name}/image_raw/compressed", image
            return
        for timed in self._packets():
            yield (
                timed.media_s,
                f"/{name}/image_raw/compressed_video",
                make(
                    COMPRESSED_VIDEO,
                    frame_id=optical_frame(name),
                    data=np.frombuffer(timed.packet.data, dtype=np.uint8),
                    format=_FORMATS[timed.packet.codec],
                ),
            )

    def _packets(self) -> Iterator[TimedPacket]:
        video, facts = self.camera.video, self.camera.video.facts
        if not self.is_copied:
            yield from h264_packets(video.frames(self.threads), facts.rotation_deg, facts.rate_hz, self.threads)
            return
        has_begun = False
        for timed in video.packets():
            has_begun = has_begun or timed.packet.is_key
            if has_begun:
                yield timed
            else:
                self.tally.without_key += 1


def _stamped(stamp_ns: int, topic: str, message: Message) -> StampedMessage:
    cdr = bytes(recording_typestore().serialize_cdr(message, message.__msgtype__))
    return StampedMessage(stamp_ns, topic, message.__msgtype__, cdr)
