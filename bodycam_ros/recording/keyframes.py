"""Images out of the middle of a recording: of a video from the keyframe before them on, which stands alone."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping

from bodycam_ros.camera.camera_image import CameraImage, VideoPacket
from bodycam_ros.recording.video_decoder import decode_last

LATE_NS = 1_000_000_000
"""Images are recorded so much earlier or later after their stamps than the first one, at most."""

_GOP_NS, _LONGEST_GOP_NS = 500_000_000, 60_000_000_000
"""How far back a video's keyframe is searched for first, twice as far then, and at most."""

_FEW_KEYFRAMES = 4
_AFTER_KEY_NS = 1_000_000_000

Messages = Callable[[Collection[str], int, int], Iterator[CameraImage]]
"""Gives the images of some cameras as they are recorded, from a time of recording until before another [ns]."""


def key_before(messages: Messages, begin_ns: int, cameras: Collection[str], recorded_ns: int) -> int:
    """A time of recording from which on all images recorded from another on can be decoded [ns].

    Args:
        messages: of the recording.
        begin_ns: when its first message was recorded [ns].
        cameras: names.
        recorded_ns: when the first of these images was recorded, at the earliest [ns].
    """
    before_ns = 0
    while True:
        start_ns = recorded_ns - before_ns
        there, decodable = set[str](), set[str]()
        for image in messages(cameras, start_ns, recorded_ns + LATE_NS):
            if _stands_alone(image) and (image.recorded_ns <= recorded_ns or image.camera not in there):
                decodable.add(image.camera)
            there.add(image.camera)
        if decodable == there or start_ns <= begin_ns or before_ns > _LONGEST_GOP_NS:
            return max(start_ns, begin_ns)
        before_ns = max(_GOP_NS, 2 * before_ns)


def images_at(messages: Messages, begin_ns: int, rows: Mapping[str, tuple[int, int]]) -> dict[str, CameraImage]:
    """Camera -> one image of it; those that are there.

    Args:
        messages: of the recording.
        begin_ns: when its first message was recorded [ns].
        rows: camera -> when the image was recorded, and its stamp [ns].
    """
    wanted = dict(rows)
    found = dict[str, CameraImage]()
    before_ns = 0
    while wanted:
        recorded_ns = [recorded_ns for recorded_ns, _ in wanted.values()]
        start_ns = min(recorded_ns) - before_ns
        read: dict[str, list[CameraImage]] = {camera: [] for camera in wanted}
        for image in messages(wanted, start_ns, max(recorded_ns) + 1):
            if image.stamp_ns <= wanted[image.camera][1]:
                read[image.camera].append(image)
        is_all = start_ns <= begin_ns or before_ns >= _LONGEST_GOP_NS
        for camera, images in read.items():
            keys = [number for number, image in enumerate(images) if _stands_alone(image)]
            if images and (keys or is_all):
                found[camera] = decode_last(images[keys[-1] if keys else 0 :])
            if keys or is_all or not images:
                del wanted[camera]
        before_ns = max(_GOP_NS, 2 * before_ns)
    return found


def keyframe_samples(
    images: Iterable[CameraImage], begin_ns: int, length_ns: int, most: int
) -> dict[str, dict[int, CameraImage]]:
    """Camera -> number -> image decoded from keyframes, of cameras that record videos; others are left out.

    Args:
        images: of the whole recording.
        begin_ns: when its first message was recorded [ns].
        length_ns: from then to the last [ns].
        most: parts of equal length, each of which gives the first keyframe of a camera, with an even number, and where
            keyframes are rare the image a second later, with the odd number after it.
    """
    parts: dict[str, dict[int, list[CameraImage]]] = {}
    for image in images:
        packet = image.content
        if not isinstance(packet, VideoPacket):
            continue
        own = parts.setdefault(image.camera, {})
        part = min(most - 1, (image.recorded_ns - begin_ns) * most // length_ns)
        if packet.is_key and part not in own:
            own[part] = [image]
        elif own and not packet.is_key:
            latest = own[max(own)]
            if image.recorded_ns - latest[0].recorded_ns <= _AFTER_KEY_NS:
                latest.append(image)
    found: dict[str, dict[int, CameraImage]] = {}
    for camera, own in parts.items():
        found[camera] = {2 * part: decode_last(images[:1]) for part, images in own.items()}
        if len(own) < _FEW_KEYFRAMES:
            found[camera] |= {2 * part + 1: decode_last(images) for part, images in own.items() if len(images) > 1}
    return found


def _stands_alone(image: CameraImage) -> bool:
    return not isinstance(image.content, VideoPacket) or image.content.is_key
