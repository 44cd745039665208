"""A camera that was blind is registered again within half a second of sight."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.relocalisation import blind_images, registered, returns
from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.reference_map import ReferenceMap


@pytest.fixture(scope="module")
def reference_map(sample: Path) -> ReferenceMap:
    return ReferenceMap.load(sample / "map")


@pytest.mark.parametrize("name", ["foot_left", "forearm_right", "head"])
def test_it_is_back_within_half_a_second(sample: Path, reference_map: ReferenceMap, name: str) -> None:
    with open_recording(sample / "sample" / "bag") as recording:
        camera = recording.camera_model(name)
        images = [(decode_grey(image), image.stamp_ns) for image in recording.images([name])]
    blind = blind_images(images, 0.8, 0.2, 0.1)
    assert blind.sum() > 30
    poses = registered(camera, reference_map, images, blind)
    assert not any(pose is not None for pose, grey in zip(poses, blind, strict=True) if grey)
    back = list(returns(images, blind, registered(camera, reference_map, images), poses))
    assert len(back) == 2
    assert max(each.after_s for each in back) <= 0.1


def test_returns_count_from_the_first_image_that_could_be_registered() -> None:
    images = [(np.zeros((1, 1), np.uint8), round(1e8 * number)) for number in range(20)]
    blind = blind_images(images, 0.5, 0.5, 0.0)
    assert np.flatnonzero(blind).tolist() == [0, 1, 2, 3, 4, 10, 11, 12, 13, 14]
    some = np.eye(4)
    usual = [None if number == 5 else some for number in range(20)]
    poses = [some if number in (8, 9) else None for number in range(20)]
    first, second = returns(images, blind, usual, poses)
    assert first.stamp_ns == images[6][1] and first.after_s == pytest.approx(0.2)
    assert second.stamp_ns == images[15][1] and np.isinf(second.after_s)
