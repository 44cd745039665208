"""Keyframes are chosen by how far each camera has moved, sharp, and of the same instant where that is asked for."""

from pathlib import Path

import cv2
import pytest
from unshown_progress import Unshown

from bodycam_ros.errors import MapError
from bodycam_ros.mapping.worn_keyframes import WornKeyframeSettings, keep_worn_keyframes

BAG = Path(__file__).parents[2] / "bags/sample/bag"


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
    with pytest.raises(MapError, match="tail.*foot_left"):
        keep_worn_keyframes(BAG, ("tail",), [], tmp_path / "k", None, WornKeyframeSettings(), 1, Unshown())
    assert not (tmp_path / "k").exists()
