from collections.abc import Callable

import numpy as np
import pytest
from helpers.made_video import make_video, number_in

from bodycam_ros.camera.camera_image import CameraImage, VideoPacket, decode_grey
from bodycam_ros.errors import RecordingError
from bodycam_ros.recording.video_decoder import VideoDecoder
from bodycam_ros.recording.video_file import packets


@pytest.fixture(scope="module", params=["libx264", "libx265"])
def images(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> list[CameraImage]:
    """Forty frames with a keyframe in ten, whose stamps are their numbers."""
    path = make_video(tmp_path_factory.mktemp("video") / "head.mp4", codec=request.param)
    return [CameraImage("head", 100 + number, packet) for number, (_, packet) in enumerate(packets(path))]


def fed(images: list[CameraImage]) -> list[CameraImage]:
    decoder = VideoDecoder()
    return [ready for image in images for ready in decoder.feed(image)] + decoder.flush()


def numbers(images: list[CameraImage]) -> list[int | None]:
    """Which picture each image is, by its pixels; None where it could not be decoded."""
    seen: list[int | None] = []
    for image in images:
        try:
            seen.append(number_in(decode_grey(image)))
        except RecordingError as error:
            assert f"stamp {image.stamp_ns} ns" in str(error)
            seen.append(None)
    return seen


def with_data(image: CameraImage, change: Callable[[bytes], bytes]) -> CameraImage:
    packet = image.content
    assert isinstance(packet, VideoPacket)
    return CameraImage(image.camera, image.stamp_ns, VideoPacket(packet.codec, change(packet.data)))


def test_each_frame_keeps_its_own_stamp(images: list[CameraImage]) -> None:
    ready = fed(images)
    assert [image.stamp_ns - 100 for image in ready] == numbers(ready) == list(range(40))
    keys = [number for number, image in enumerate(images) if image.content.is_key]
    assert keys == [0, 10, 20, 30]


@pytest.mark.parametrize("damage", ["cut", "empty", "noise"])
def test_a_damaged_frame_costs_those_up_to_the_next_keyframe(images: list[CameraImage], damage: str) -> None:
    change = {
        "cut": lambda d: d[: len(d) // 3],
        "empty": lambda d: b"",
        "noise": lambda d: b"\x00\x00\x01\x41" + d[40:],
    }
    hurt = list(images)
    hurt[13] = with_data(images[13], change[damage])
    ready = fed(hurt)
    assert [image.stamp_ns - 100 for image in ready] == list(range(40))
    seen = numbers(ready)
    assert seen[:13] == list(range(13))
    assert seen[20:] == list(range(20, 40))
    # FFmpeg's HEVC decoder takes a slice that ends early for a whole one.
    assert seen[13] is None or (damage == "cut" and images[0].content.codec == "hevc")


def test_random_bytes_are_refused(images: list[CameraImage]) -> None:
    random = np.random.default_rng(2)
    noise = [with_data(image, lambda d: random.bytes(len(d))) for image in images]
    assert numbers(fed(noise)) == [None] * 40
    flipped = [with_data(image, lambda d: bytes(b ^ (random.random() < 0.01) for b in d)) for image in images]
    assert len(fed(flipped)) == 40
