"""What one camera recorded, its chapters joined: cameras begin a new file every few gigabytes."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import av
import numpy as np

from bodycam_ros.errors import RecordingError
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.recording import video_file
from bodycam_ros.recording.sound import SoundBlock, sound_blocks
from bodycam_ros.recording.telemetry import inertial_samples, stabilisation
from bodycam_ros.recording.video_file import FileFacts, TimedPacket, read_facts

_CLOCK_S = 2.0
"""Times of creation are whole seconds, taken now before the first frame, now after it."""

_SAME_RATE = 0.1
"""Share by which the mean rates of two chapters may differ, as by frames that were dropped in the dark."""

_RATE_FRAMES = 24  # a last chapter of fewer has no rate worth comparing

_GOPRO_CHAPTER = re.compile(r"G[HXLP](\d\d)\d{4}$", re.IGNORECASE)
_COMPARED = 65_536  # [bytes] of both ends, by which a copy is found


@dataclass(frozen=True)
class Chapter:
    """One file of a camera.

    Attributes:
        path: of the file.
        facts: what is in it.
        start_s: media time of the camera at media time 0 of the file [s].
    """

    path: Path
    facts: FileFacts
    start_s: float


@dataclass(frozen=True)
class CameraVideo:
    """One camera's recording. Its media time begins with the first chapter and goes on through all of them.

    Attributes:
        camera: its name.
        chapters: its files, in order.
    """

    camera: str
    chapters: tuple[Chapter, ...]

    @classmethod
    def of_files(cls, camera: str, paths: Sequence[Path]) -> "CameraVideo":
        """Look at a camera's files, which follow each other.

        Raises:
            RecordingError: one is no video, they differ in size, codec, rotation or rate, or overlap in time.
        """
        chapters: list[Chapter] = []
        start_s = 0.0
        for path in paths:
            facts = read_facts(path)
            if chapters and _overlap(chapters[-1], path, facts):
                raise RecordingError(
                    f"{chapters[-1].path} and {path} overlap in time; chapters follow each other: give the files of "
                    "one recording, each once",
                    camera,
                )
            chapters.append(Chapter(path, facts, start_s))
            start_s += facts.duration_s
            first = chapters[0]
            if _form(facts) != _form(first.facts) or _differ_in_rate(facts, first.facts):
                raise RecordingError(
                    f"{path} ({_describe(facts)}) does not go on from {first.path} "
                    f"({_describe(first.facts)}); give the files of one recording, a folder for each recording",
                    camera,
                )
        return cls(camera, tuple(chapters))

    @property
    def is_joined_by_name(self) -> bool:
        """Whether nothing but ``_1``, ``_2`` in their names says that the files are chapters of one recording."""
        return any(
            after.facts.created is None and _GOPRO_CHAPTER.match(after.path.stem) is None for after in self.chapters[1:]
        )

    def parts(self) -> list["CameraVideo"]:
        """The video cut where chapters do not follow each other: the camera was stopped, or a file is missing.

        Later parts are named after the camera and their number: ``head, part 2``. Each has media times of its own.
        """
        gaps = [k for k in range(1, len(self.chapters)) if _has_gap(self.chapters[k - 1], self.chapters[k])]
        parts = []
        for number, (first, end) in enumerate(zip([0, *gaps], [*gaps, len(self.chapters)], strict=True), start=1):
            start_s = self.chapters[first].start_s
            chapters = (replace(chapter, start_s=chapter.start_s - start_s) for chapter in self.chapters[first:end])
            name = self.camera if number == 1 else f"{self.camera}, part {number}"
            parts.append(CameraVideo(name, tuple(chapters)))
        return parts

    @property
    def path(self) -> Path:
        """The first file."""
        return self.chapters[0].path

    @property
    def files(self) -> list[Path]:
        """All files, in order."""
        return [chapter.path for chapter in self.chapters]

    @property
    def facts(self) -> FileFacts:
        """Facts of all chapters together."""
        facts = [chapter.facts for chapter in self.chapters]
        return replace(
            facts[0],
            has_b_frames=any(f.has_b_frames for f in facts),
            duration_s=sum(f.duration_s for f in facts),
            frames=sum(f.frames for f in facts) if all(f.frames for f in facts) else 0,
            has_sound=any(f.has_sound for f in facts),
        )

    def packets(self) -> Iterator[TimedPacket]:
        """The frames, compressed, in the order stored; see ``video_file.packets``."""
        for chapter in self.chapters:
            for media_s, packet in video_file.packets(chapter.path):
                yield media_s + chapter.start_s, packet

    def frames(self, threads: int = 0) -> Iterator[tuple[float, av.VideoFrame]]:
        """The frames, decoded, in the order shown; see ``video_file.frames``."""
        for chapter in self.chapters:
            for media_s, frame in video_file.frames(chapter.path, threads):
                yield media_s + chapter.start_s, frame

    def sound(self) -> Iterator[SoundBlock]:
        """The sound; none if the camera has none. See ``sound_blocks``."""
        for chapter in self.chapters:
            for block in sound_blocks(chapter.path):
                yield replace(block, start_s=block.start_s + chapter.start_s)

    def stabilisation(self) -> str:
        """What in a GoPro's file shows that frames are stabilised electronically; empty if nothing does."""
        return next((reason for path in self.files if (reason := stabilisation(path))), "")

    def inertial_samples(self) -> ImuSamples | None:
        """Gyroscope and accelerometer of a GoPro, in the camera's media time; None without telemetry.

        Raises:
            RecordingError: see ``telemetry.inertial_samples``.
        """
        parts = [
            replace(samples, stamps_ns=samples.stamps_ns + round(1e9 * chapter.start_s))
            for chapter in self.chapters
            if (samples := inertial_samples(chapter.path)) is not None
        ]
        if not parts:
            return None
        columns = zip(*((part.stamps_ns, part.angular_velocity, part.acceleration) for part in parts), strict=True)
        stamps_ns, angular_velocity, acceleration = (np.concatenate(column) for column in columns)
        later = np.concatenate([[True], stamps_ns[1:] > np.maximum.accumulate(stamps_ns)[:-1]])
        return ImuSamples(stamps_ns[later], angular_velocity[later], acceleration[later])


def _overlap(before: Chapter, path: Path, facts: FileFacts) -> bool:
    """Whether a file is another's copy, or began by the camera's clock while that was still being recorded."""
    if path.stat().st_size == before.path.stat().st_size and _ends(path) == _ends(before.path):
        return True
    if before.facts.created is None or facts.created is None:
        return False
    later_s = (facts.created - before.facts.created).total_seconds()
    # Some cameras give all chapters the time at which the first began.
    return _CLOCK_S < later_s < before.facts.duration_s - _CLOCK_S


def _has_gap(before: Chapter, after: Chapter) -> bool:
    """Whether a file begins later than the one before ends, by the camera's clock or the numbers in their names."""
    earlier, later = (_GOPRO_CHAPTER.match(chapter.path.stem) for chapter in (before, after))
    if earlier and later and int(later[1]) > int(earlier[1]) + 1:
        return True
    created = before.facts.created, after.facts.created
    if created[0] is None or created[1] is None:
        return False
    return (created[1] - created[0]).total_seconds() > before.facts.duration_s + _CLOCK_S


def _ends(path: Path) -> tuple[bytes, bytes]:
    with path.open("rb") as file:
        start = file.read(_COMPARED)
        file.seek(max(0, path.stat().st_size - _COMPARED))
        return start, file.read()


def _form(facts: FileFacts) -> tuple[object, ...]:
    return facts.codec, facts.width, facts.height, facts.rotation_deg


def _differ_in_rate(first: FileFacts, second: FileFacts) -> bool:
    """Whether two files have other frame rates, as far as these are known."""
    low, high = sorted((first.rate_hz, second.rate_hz))
    enough = min(first.about_frames, second.about_frames) >= _RATE_FRAMES
    return enough and low > 0.0 and high > (1.0 + _SAME_RATE) * low


def _describe(facts: FileFacts) -> str:
    turned = f", turned by {facts.rotation_deg} deg" if facts.rotation_deg else ""
    return f"{facts.width} x {facts.height}, {facts.rate_hz:.4g} frames/s, {facts.codec}{turned}"
