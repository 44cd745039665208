"""Videos of cameras into one bag, in the time of one of them."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from threading import Event

from bodycam_ros.errors import RecordingError
from bodycam_ros.ingest.camera_offsets import Offsets, plausible_time
from bodycam_ros.ingest.camera_remarks import Causes, left_out_lines
from bodycam_ros.ingest.clock_fit import CameraTime
from bodycam_ros.ingest.frame_stream import BY_STAMP, FrameStream, for_each_camera, merged_ahead
from bodycam_ros.ingest.ingest_camera import IngestCamera, check_any
from bodycam_ros.ingest.timing_file import TIMING_FILE, timing_text
from bodycam_ros.lens.lens_check import LensMatch, match_images
from bodycam_ros.progress import Progress
from bodycam_ros.recording.bag_writer import INGEST, write_recording
from bodycam_ros.recording.time_span import TimeSpan

_WHOLE = TimeSpan()
_EPOCH = datetime(2020, 1, 1, tzinfo=UTC)  # time 0 of a recording whose reference has no time of creation
_SOURCES, _FINDINGS_FILE = "videos", "findings.json"
"""Record: camera -> its first file; attachment: cameras that were left out, and remarks on the others."""

_MOST_LENS_FRAMES = 900  # a camera that lies still for all of them is not compared with its lens


@dataclass(frozen=True)
class IngestSummary:
    """What became of all cameras.

    Attributes:
        streams: what was read of the cameras in the bag, by name.
        left_out: camera that is not in the bag though it has a clock -> why.
        base: UTC of the recording's time 0.
    """

    streams: tuple[FrameStream, ...]
    left_out: Causes
    base: datetime

    @property
    def duration_s(self) -> float:
        """From the first frame of all to the last [s]."""
        return 1e-9 * (max(each.last_ns for each in self.streams) - min(each.first_ns for each in self.streams))


def ingest(
    cameras: Sequence[IngestCamera],
    offsets: Offsets,
    output: Path,
    jobs: int,
    force: bool,
    progress: Progress,
    span: TimeSpan = _WHOLE,
) -> IngestSummary:
    """Write the bag: every frame at ``base + CameraTime.recording_s(its own media time)``.

    Frames go into the bag as the camera compressed them, if H.264 or HEVC without B-frames, upright and not scaled;
    else they are compressed anew.

    Args:
        cameras: what is to go into it.
        offsets: clocks of the cameras; those that are left out have none. The bag carries them as ``timing.yaml``.
        output: ros2 bag folder to be; it appears whole or not at all.
        jobs: threads that decode and compress.
        force: replace a bag that an ingest wrote.
        progress: of the frames.
        span: the part that is written, since the first camera starts; copied videos begin at the keyframe before it.

    Raises:
        RecordingError: no camera can be read.
        OutputError: the bag cannot be written.
    """
    times = offsets.times
    timed, causes = overlapping([camera for camera in cameras if camera.name in times], times)
    check_any(timed, causes)
    base = _base(timed, times)
    base_ns = round(base.timestamp() * 1e6) * 1000
    threads = max(1, jobs // len(timed))
    window_s = _window(span, min(times[camera.name].start_s for camera in timed))
    streams = [FrameStream(camera, times[camera.name], base_ns, threads, window_s) for camera in timed]
    frames = sum(camera.video.facts.about_frames for camera in timed)
    with write_recording(output, force, INGEST) as writer:
        writer.add_metadata(_SOURCES, {camera.topic_name: camera.video.path.name for camera in timed})
        writer.add_metadata("settings", {f"{camera.topic_name}.scale": str(camera.scale) for camera in timed})
        writer.attach(TIMING_FILE, "application/yaml", timing_text(offsets), base_ns)
        messages = [stream.messages() for stream in streams]
        with merged_ahead(messages, BY_STAMP, jobs) as merged, progress.step("writing", frames) as advance:
            for message in merged:
                writer.write_serialized(*message)
                advance(int("/image_raw" in message.topic))
        causes |= {stream.camera.name: _why_empty(stream) for stream in streams if not stream.frames}
        written = [stream for stream in streams if stream.frames]
        check_any([stream.camera for stream in written], causes)
        remarks = (line for stream in written for line in stream.remark_lines())
        found = json.dumps([*left_out_lines(causes), *remarks])
        for folder in {camera.video.path.parent for camera in timed}:  # equal videos elsewhere give an equal bag
            found = found.replace(f"{folder}/", "")
        writer.attach(_FINDINGS_FILE, "application/json", found, base_ns)
    return IngestSummary(tuple(written), causes, base)


def _window(span: TimeSpan, first_s: float) -> tuple[float, float]:
    """From when to when a part lasts, in the recording's time [s]; all time for all of it."""
    start_s = first_s + span.from_s if span.from_s > 0.0 else -math.inf
    return start_s, first_s + span.to_s


def _interval(camera: IngestCamera, times: Mapping[str, CameraTime]) -> tuple[float, float]:
    """Start and end of a camera in the recording's time [s]."""
    time = times[camera.name]
    return time.start_s, time.start_s + (1.0 + time.drift) * camera.video.facts.duration_s


def overlapping(
    cameras: Sequence[IngestCamera], times: Mapping[str, CameraTime]
) -> tuple[list[IngestCamera], dict[str, str]]:
    """The cameras that run while another does, and why each of the others is left out: camera -> cause.

    Args:
        cameras: that have a clock.
        times: camera -> its clock.
    """
    kept: list[IngestCamera] = []
    causes: dict[str, str] = {}
    for camera in cameras:
        begin_s, end_s = _interval(camera, times)
        others = [_interval(other, times) for other in cameras if other.topic_name != camera.topic_name]
        if not others or any(begin < end_s and begin_s < end for begin, end in others):
            kept.append(camera)
            continue
        latest_s, earliest_s = max(end for _, end in others), min(begin for begin, _ in others)
        when = (
            f"begins {begin_s - latest_s:.1f} s after all others have ended"
            if begin_s >= latest_s
            else f"ends {earliest_s - end_s:.1f} s before any other begins"
            if end_s <= earliest_s
            else "runs while no other does"
        )
        causes[camera.name] = f"{camera.video.path} {when}; check that it is of this recording"
    return kept, causes


def _base(cameras: Sequence[IngestCamera], times: Mapping[str, CameraTime]) -> datetime:
    """UTC of the recording's time 0: when the reference began, by its own clock, if that was set."""
    reference = min(cameras, key=lambda camera: (abs(times[camera.name].start_s), times[camera.name].start_sigma_s))
    return plausible_time(reference.video.facts.created) or _EPOCH


def _why_empty(stream: FrameStream) -> str:
    if not (stream.fault or stream.is_whole):
        return f"{stream.camera.video.path} has no frame in that part"
    return stream.fault or f"none of the frames of {stream.camera.video.path} can be read"


def lens_remarks(cameras: Sequence[IngestCamera], progress: Progress) -> list[str]:
    """A line for each camera whose images do not fit its lens, with the likely mode."""
    by_name = {camera.name: camera for camera in cameras}

    def match(name: str, ended: Event) -> LensMatch:
        lens, images = by_name[name].lens, by_name[name].grey_images(ended)
        try:
            return match_images(lens, (grey for _, grey in images), _MOST_LENS_FRAMES)
        except RecordingError:  # named when it is written
            return match_images(lens, [])

    matches = for_each_camera(by_name, match, "comparing lenses", progress)
    return [each.text for each in matches.values() if not each.matches]
