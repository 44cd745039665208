"""What a map covers, in a round hall whose wall is known all around, but for a part."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.recorded_progress import Unshown

from bodycam_ros.evaluate.coverage import (
    BODY_CAMERA,
    Coverage,
    coverage_lines,
    find_gaps,
    measure_coverage,
    upright_map,
    with_coverage,
)
from bodycam_ros.geometry import exp_so3
from bodycam_ros.registration.reference_map import ReferenceMap

RADIUS_M = 6.0


def hall(first_deg: float, last_deg: float, landmarks: int = 3000, size_m: float = 0.1) -> ReferenceMap:
    """A map of the wall from one azimuth on, counter-clockwise, to another; photographed from near the middle."""
    rng = np.random.default_rng(3)
    azimuth = np.radians(rng.uniform(first_deg, last_deg, landmarks))
    points = np.column_stack(
        [RADIUS_M * np.cos(azimuth), RADIUS_M * np.sin(azimuth), rng.uniform(-4.0, 6.0, landmarks)]
    )
    towards = np.array([0.0, 0.0, 1.0]) - points
    looks = np.radians(np.arange(first_deg, last_deg, 20.0))
    poses = np.tile(np.eye(4), (len(looks), 1, 1))
    forward = np.column_stack([np.cos(looks), np.sin(looks), 0.0 * looks])
    right = np.column_stack([np.sin(looks), -np.cos(looks), 0.0 * looks])
    poses[:, :3, :3] = np.stack([right, np.cross(forward, right), forward], axis=2)
    poses[:, :3, 3] = 0.3 * forward + [0.0, 0.0, 1.0]
    return ReferenceMap(
        landmark_ids=np.arange(landmarks, dtype=np.uint32),
        points_world=points,
        colours=np.zeros((landmarks, 3), np.uint8),
        descriptor_landmark=np.arange(landmarks, dtype=np.uint32),
        descriptors=np.zeros((landmarks, 128), np.uint8),
        descriptor_view=(towards / np.linalg.norm(towards, axis=1, keepdims=True)).astype(np.float32),
        descriptor_size=np.full(landmarks, size_m, np.float32),
        world_T_camera=poses,
        image_names=tuple(f"{degrees:.0f}.jpg" for degrees in np.degrees(looks)),
        metric=True,
        gravity_aligned=True,
    )


def measured(reference_map: ReferenceMap) -> Coverage:
    return measure_coverage(reference_map, Unshown())


def apart_deg(first: float, second: float) -> float:
    return abs((first - second + 180.0) % 360.0 - 180.0)


@pytest.mark.parametrize("middle_deg", [105.0, -40.0, 180.0])
def test_the_wall_that_is_missing_is_named(middle_deg: float) -> None:
    """Wherever it is, on the seam of azimuths as well."""
    reference_map = hall(middle_deg + 80.0, middle_deg + 280.0)
    coverage = measured(reference_map)
    assert 0.3 < coverage.share < 0.9
    (gap,) = find_gaps(coverage)
    assert apart_deg(gap.azimuth_deg, middle_deg) < 8.0
    assert not gap.all_around
    assert gap.share < 0.5
    assert f"{gap.azimuth_deg:.0f} deg" in coverage_lines(coverage)[1]
    summary = with_coverage(reference_map, coverage).summary["coverage"]
    assert summary["gaps"][0]["azimuth_deg"] == round(gap.azimuth_deg)


def test_counts_are_those_of_a_projection() -> None:
    """What a camera sees is counted anew, landmark by landmark."""
    reference_map = hall(0.0, 220.0, landmarks=600)
    coverage = measured(reference_map)
    place = 3
    elevation = 5
    azimuth = 14
    forward_azimuth = np.radians(coverage.azimuths_deg[azimuth])
    forward_elevation = np.radians(coverage.elevations_deg[elevation])
    across = np.array([np.sin(forward_azimuth), -np.cos(forward_azimuth), 0.0])
    ahead = np.array(
        [
            np.cos(forward_elevation) * np.cos(forward_azimuth),
            np.cos(forward_elevation) * np.sin(forward_azimuth),
            np.sin(forward_elevation),
        ]
    )
    world_R_camera = np.stack([across, np.cross(ahead, across), ahead], axis=1)
    seen = 0
    for row, point in enumerate(reference_map.points_world):
        offset = point - coverage.places_world[place]
        pixel, valid = BODY_CAMERA.project((world_R_camera.T @ offset)[None])
        cosine = -reference_map.descriptor_view[row] @ offset / np.linalg.norm(offset)
        scale_px = BODY_CAMERA.fx * reference_map.descriptor_size[row] / np.linalg.norm(offset)
        seen += bool(valid[0] and BODY_CAMERA.in_image(pixel)[0] and cosine > 0.5 and scale_px > 1.0)
    assert seen > 40
    assert coverage.visible[place, elevation, azimuth] == seen


def test_a_map_whose_z_is_not_up_is_covered_alike() -> None:
    """Photographs are upright on average; without that, a wall would be taken for the ceiling."""
    known = hall(60.0, 280.0)
    R = exp_so3(np.array([1.4, -0.3, 0.2]))
    poses = known.world_T_camera.copy()
    poses[:, :3] = R @ poses[:, :3]
    turned = replace(
        known,
        points_world=known.points_world @ R.T,
        descriptor_view=known.descriptor_view @ R.T.astype(np.float32),
        world_T_camera=poses,
        gravity_aligned=False,
    )
    upright = upright_map(turned)
    assert upright.points_world[:, 2] == pytest.approx(known.points_world[:, 2], abs=1e-6)
    found, wanted = measured(upright), measured(replace(known, gravity_aligned=False))
    assert found.share == pytest.approx(wanted.share, abs=0.02)
    (gap,), (true,) = find_gaps(found), find_gaps(wanted)
    assert gap.elevations_deg == true.elevations_deg and not gap.all_around
    assert upright_map(known) is known
