"""A changed world is the same map of other photographs."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from tools.changed_world import change_world, decoded
from two_cameras import write_map

from bodycam_ros.camera import camera_from_info
from bodycam_ros.registration.map_photographs import MapPhotographs
from bodycam_ros.registration.reference_map import ReferenceMap

_WIDTH, _HEIGHT, _VIEWS = 160, 120, 4


def _map_with_photographs(path: Path) -> ReferenceMap:
    plain = ReferenceMap.load(write_map(path / "plain"))
    rng = np.random.default_rng(0)
    pictures = [
        cv2.resize(rng.integers(0, 255, (15, 20), dtype=np.uint8), (_WIDTH, _HEIGHT), interpolation=cv2.INTER_CUBIC)
        for _ in range(_VIEWS)
    ]
    world_T_camera = np.tile(np.eye(4), (_VIEWS, 1, 1))
    landmarks = len(plain.landmark_ids)
    k = (80.0, 0.0, 79.5, 0.0, 80.0, 59.5, 0.0, 0.0, 1.0)
    photographs = MapPhotographs(
        jpegs=tuple(cv2.imencode(".jpg", picture)[1].tobytes() for picture in pictures),
        cameras=(camera_from_info("photograph", _WIDTH, _HEIGHT, "plumb_bob", np.zeros(5), k),),
        camera_of_view=np.zeros(_VIEWS, np.uint16),
        world_T_camera=world_T_camera,
        observation_landmark=np.arange(landmarks, dtype=np.uint32),
        observation_view=np.zeros(landmarks, np.uint16),
        normals=np.tile(np.float32([0.0, 0.0, 1.0]), (landmarks, 1)),
    )
    names = tuple(f"{view}.jpg" for view in range(_VIEWS))
    whole = replace(plain, world_T_camera=world_T_camera, image_names=names, photographs=photographs)
    whole.save(path / "map")
    return whole


@pytest.mark.parametrize("share", [0.2, 0.5])
def test_the_share_of_each_photograph_is_replaced_and_all_else_stays(tmp_path: Path, share: float) -> None:
    before = _map_with_photographs(tmp_path).photographs
    assert before is not None
    for name, seed in (("one", 0), ("same", 0), ("other", 1)):
        change_world(tmp_path / "map", tmp_path / name, share, seed)
    changed = {name: ReferenceMap.load(tmp_path / name).photographs for name in ("one", "same", "other")}
    one = changed["one"]
    assert one is not None and changed["same"] is not None and changed["other"] is not None
    assert one.jpegs == changed["same"].jpegs != changed["other"].jpegs
    for old, new in zip(decoded(before), decoded(one), strict=True):
        differs = np.abs(old.astype(int) - new.astype(int)) > 12
        assert share * 0.75 < differs.mean() < share + 0.08
    np.testing.assert_array_equal(one.observation_view, before.observation_view)
    for file in ("landmarks.npz", "map.yaml"):
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "map" / file).read_bytes()


def test_a_map_without_photographs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="without photographs"):
        change_world(write_map(tmp_path / "map"), tmp_path / "out", 0.2, 0)
    assert not (tmp_path / "out").exists()
