"""Keyframes are chosen by how far each camera has moved, sharp, and of the same instant where that is asked for."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest

from bodycam_ros.errors import MapError
from bodycam_ros.mapping.frame_motion import FrameMotion
from bodycam_ros.mapping.progress import Advance
from bodycam_ros.mapping.worn_keyframes import WornKeyframeSettings, _chosen, keep_worn_keyframes

BAG = Path(__file__).parents[2] / "bags/sample/bag"
FRAMES = 301


class Unshown:
    """Progress that nobody sees."""

    @contextmanager
    def step(self, name: str, total: int) -> Iterator[Advance]:
        yield lambda units=1: None


def moving(path_deg: float, still: int = 0) -> FrameMotion:
    """Frames of a camera that stands still first, and then moves evenly; every fourth is sharp."""
    path = np.concatenate([np.zeros(still), np.linspace(0.0, path_deg, FRAMES - still)])
    sharpness = np.where(np.arange(FRAMES) % 4 == 0, 10.0, 4.0)
    return FrameMotion(np.arange(FRAMES) / 30.0, sharpness, path, np.zeros((FRAMES, 3)))


def test_who_moves_more_gives_more_and_only_sharp_frames() -> None:
    rows = _chosen(
        {"arm": moving(900.0, 45), "waist": moving(300.0, 45), "still": moving(0.0)},
        WornKeyframeSettings(most=60, fewest=5),
    )
    assert 38 <= len(rows["arm"]) <= 46 and 12 <= len(rows["waist"]) <= 16 and len(rows["still"]) <= 2
    for chosen in rows.values():
        assert (chosen % 4 == 0).all() and (np.diff(chosen) > 0).all()
    # Standing still gives one frame, however long it takes.
    assert np.count_nonzero(rows["arm"] < 40) <= 2
    assert np.diff(rows["waist"][1:-1]).max() < 3 * (FRAMES - 45) / len(rows["waist"])


def test_pictures_are_kept_with_their_cameras_and_times(tmp_path: Path) -> None:
    kept = keep_worn_keyframes(
        BAG,
        ("waist_left", "waist_right"),
        [("waist_left", "waist_right")],
        tmp_path / "keyframes",
        None,
        WornKeyframeSettings(most=10, fewest=4, min_step_deg=1.0),
        2,
        Unshown(),
    )
    assert sorted(path.name for path in kept.folder.iterdir()) == [path.name for path in kept.paths]
    assert set(kept.camera_of_name) == set(kept.moments) == {path.name for path in kept.paths}
    times = {
        camera: [moment.seconds for moment in kept.moments.values() if moment.camera == camera]
        for camera in ("waist_left", "waist_right")
    }
    assert len(times["waist_left"]) >= 3
    # The other has a keyframe of each of its instants.
    assert all(min(abs(seconds - other) for other in times["waist_right"]) < 0.01 for seconds in times["waist_left"])
    for path in kept.paths:
        camera = kept.camera_of_name[path.name]
        assert path.name.startswith(kept.moments[path.name].camera)
        assert cv2.imread(str(path), cv2.IMREAD_GRAYSCALE).shape == (camera.height, camera.width)
    assert len({id(camera) for camera in kept.camera_of_name.values()}) == 2


def test_a_camera_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(MapError, match="no camera tail; there are foot_left"):
        keep_worn_keyframes(BAG, ("tail",), [], tmp_path / "k", None, WornKeyframeSettings(), 1, Unshown())
    assert not (tmp_path / "k").exists()
