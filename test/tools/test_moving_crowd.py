"""People of a crowd are where they walk, look alike from image to image, and change nothing else in the bag."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from known_walk import FOCAL, FRAME_NS, START_NS, make_walk, write_solved
from tiny_bag import write_camera_info, write_jpeg
from tools.moving_crowd import IMAGES, MOTIONS, Crowd, Sight, clothes, make_crowd, mill, paste_crowd, stream

from bodycam_ros.camera import camera_from_info
from bodycam_ros.geometry import inverse
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import write_recording

CAMERA = camera_from_info("any", 640, 480, "equidistant", [0.0] * 4, [FOCAL, 0, 319.5, 0, FOCAL, 239.5, 0, 0, 1])
STAMPS_NS = START_NS + np.arange(61, dtype=np.int64) * 33_333_333
LOOKING_ALONG_X = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]])


def test_a_person_is_seen_where_it_stands_and_its_clothes_go_with_it() -> None:
    poses = np.tile(np.eye(4), (len(STAMPS_NS), 1, 1, 1))
    poses[:, 0, :2, 3] = np.column_stack([np.full(61, 2.0), np.linspace(-1.0, 1.0, 61)])
    crowd = Crowd(STAMPS_NS, poses, 1.0, clothes(1, np.random.default_rng(0), None))
    sight = Sight(CAMERA, STAMPS_NS, np.tile(LOOKING_ALONG_X, (61, 1, 1)))
    grey = np.full((480, 640), 90, np.uint8)
    pictures = [sight.paste(grey, crowd, int(STAMPS_NS[row])) for row in (0, 29, 30, 60)]
    for picture, place in zip(pictures, poses[[0, 29, 30, 60], 0, :3, 3], strict=True):
        chest = place + [0.0, 0.0, 1.15]
        (pixel,), _ = CAMERA.project((inverse(LOOKING_ALONG_X) @ [*chest, 1.0])[None, :3])
        rows, columns = np.nonzero(np.abs(picture.astype(int) - 90) > 5)
        assert np.median(columns) == pytest.approx(pixel[0], abs=12)
        # 1.77 m tall, seen from 1 m above the floor
        distance = np.linalg.norm(place[:2])
        height = FOCAL * (np.arctan(1.0 / distance) + np.arctan(0.77 / distance))
        assert np.ptp(rows[np.abs(columns - pixel[0]) < 60]) == pytest.approx(height, rel=0.12)
    # Between two images the chest moves by 4 px, and looks the same there.
    patch = pictures[1][210:260, 300:330]
    likeness = cv2.matchTemplate(pictures[2][200:270, 270:360], patch, cv2.TM_CCOEFF_NORMED)
    assert likeness.max() > 0.9
    assert cv2.minMaxLoc(likeness)[3] != (30, 10)
    assert 0.02 < min(sight.covered) <= max(sight.covered) < 0.2


@pytest.mark.parametrize("name", sorted(MOTIONS))
def test_nobody_jumps_or_comes_too_near(name: str) -> None:
    wearer = np.column_stack([np.linspace(-2.0, 2.0, 61), np.zeros(61)])
    poses = MOTIONS[name](STAMPS_NS, wearer, 24, 1.0, np.random.default_rng(0))
    away = poses[:, :, :2, 3] - wearer[:, None]
    assert np.linalg.norm(away, axis=2).min() > 0.8
    steps = np.linalg.norm(np.diff(poses[:, :, :2, 3], axis=0), axis=2)
    assert np.median(steps) * 30 < 3.0
    # Only who falls behind comes in again in front.
    assert np.linalg.norm(away[:-1][steps > 0.2], axis=1).min(initial=9.0) > 2.0


def test_a_stream_goes_as_one_and_a_mill_does_not() -> None:
    wearer = np.column_stack([np.linspace(-2.0, 2.0, 61), np.zeros(61)])
    spreads = {}
    for motion in (stream, mill):
        places = motion(STAMPS_NS, wearer, 24, 1.0, np.random.default_rng(0))[..., :2, 3]
        steps = np.diff(places, axis=0)
        spreads[motion] = np.median(np.linalg.norm(steps - np.median(steps, axis=1, keepdims=True), axis=2))
    assert spreads[stream] < 1e-9 < 5e-3 < spreads[mill]


def test_only_the_images_of_the_named_cameras_change(tmp_path: Path) -> None:
    walk = make_walk()
    solved = write_solved(walk, tmp_path / "solved")
    bag = tmp_path / "bag"
    with write_recording(bag) as writer:
        for stamp_ns in range(START_NS, START_NS + 4 * FRAME_NS, FRAME_NS):
            for camera in ("waist", "shin"):
                write_camera_info(writer, camera, stamp_ns)
                write_jpeg(writer, camera, stamp_ns, stamp_ns, 90)
    crowd = make_crowd(solved, "mill", 12, 1.0, 1.2, 0, None)
    covered = paste_crowd(bag, solved, tmp_path / "out", crowd, ["shin"])
    assert set(covered) == {"shin"} and 0.05 < covered["shin"] < 0.95
    for camera, alike in (("waist", True), ("shin", False)):
        before, after = (_images(path, camera) for path in (bag, tmp_path / "out"))
        assert [a[0] for a in after] == [b[0] for b in before]
        assert ([a[1] for a in after] == [b[1] for b in before]) == alike
    with pytest.raises(SystemExit, match="no pose of elbow"):
        paste_crowd(bag, solved, tmp_path / "other", crowd, ["elbow"])


def _images(bag: Path, camera: str) -> list[tuple[int, bytes]]:
    with BagFile(bag) as file:
        return [(stamp, bytes(message.data)) for _, stamp, message in file.messages([f"/{camera}{IMAGES}"])]
