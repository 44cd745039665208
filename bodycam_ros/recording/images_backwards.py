"""The images of a recording from its end to its start, a stretch of it in memory at a time."""

from collections.abc import Collection, Iterator
from itertools import chain

from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.camera.video_packet import VideoPacket
from bodycam_ros.recording.bag_reader import Recording
from bodycam_ros.video.video_decoder import VideoDecoder

_STRETCH_NS = 1_000_000_000
_FIRST_LOOK_BACK_NS = 1_000_000_000
"""Before a stretch, for the keyframe that its first frames are made of; doubled until there is one."""


def images_backwards(recording: Recording, cameras: Collection[str]) -> Iterator[CameraImage]:
    """Yield the images of some cameras, the last recorded first.

    Within a camera stamps decrease strictly: an image whose stamp does not is left out. A video is decoded forwards, a
    stretch after the other, from the keyframe before it on: twice the work where keyframes are a second apart.
    """
    end_ns = recording.start_ns + round(1e9 * recording.duration_s) + 1
    latest: dict[str, int] = {}
    for stop_ns in range(end_ns, recording.start_ns, -_STRETCH_NS):
        start_ns = max(recording.start_ns, stop_ns - _STRETCH_NS)
        for image in reversed(_decoded_stretch(recording, cameras, start_ns, stop_ns)):
            if image.camera not in latest or image.stamp_ns < latest[image.camera]:
                latest[image.camera] = image.stamp_ns
                yield image


def _decoded_stretch(recording: Recording, cameras: Collection[str], start_ns: int, stop_ns: int) -> list[CameraImage]:
    encoded = recording.encoded_between(cameras, start_ns, stop_ns)
    wanted = {(image.camera, image.stamp_ns) for image in encoded}
    from_ns, look_back_ns = start_ns, _FIRST_LOOK_BACK_NS
    while from_ns > recording.start_ns and not _begin_with_keyframes(encoded):
        from_ns = max(recording.start_ns, start_ns - look_back_ns)
        encoded = recording.encoded_between(cameras, from_ns, stop_ns)
        look_back_ns *= 2
    decoders = {camera: VideoDecoder() for camera in cameras}
    decoded = chain(
        (ready for image in encoded for ready in decoders[image.camera].feed(image)),
        (ready for decoder in decoders.values() for ready in decoder.flush()),
    )
    # Frames before the stretch go at once: between keyframes there may be many.
    here = [image for image in decoded if (image.camera, image.stamp_ns) in wanted]
    return sorted(here, key=lambda image: image.stamp_ns)


def _begin_with_keyframes(images: list[CameraImage]) -> bool:
    first = {image.camera: image.content for image in reversed(images)}
    return all(content.is_key for content in first.values() if isinstance(content, VideoPacket))
