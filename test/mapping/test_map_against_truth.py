"""The acceptance of `bodycam map` on all photographs of the hall. Minutes of work: set BODYCAM_SLOW=1 to run it."""

import csv
import os

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from bodycam_ros.cli.main import main
from bodycam_ros.geometry import umeyama
from bodycam_ros.registration.reference_map import ReferenceMap

pytestmark = pytest.mark.skipif(not os.environ.get("BODYCAM_SLOW"), reason="takes minutes; set BODYCAM_SLOW=1")


def true_poses(path):
    with path.open() as file:
        for row in csv.DictReader(file):
            pose = np.eye(4)
            pose[:3, :3] = Rotation.from_quat([float(row[k]) for k in ("qx", "qy", "qz", "qw")]).as_matrix()
            pose[:3, 3] = [float(row[k]) for k in "xyz"]
            yield row["file"], pose


def test_the_hall_is_registered_to_scale_and_upright(shared, tmp_path):
    hall = shared / "dev_hall"
    assert main(["map", str(hall / "reference"), "-o", str(tmp_path / "map")]) == 0
    reference_map = ReferenceMap.load(tmp_path / "map")
    truth = dict(true_poses(hall / "truth" / "reference_poses.csv"))
    assert len(reference_map.image_names) >= 0.95 * len(truth)
    assert len(reference_map.landmark_ids) >= 10_000

    poses = np.array([truth[name] for name in reference_map.image_names])
    scale, R, t = umeyama(reference_map.world_T_camera[:, :3, 3], poses[:, :3, 3], with_scale=True)
    assert scale == pytest.approx(1.0, abs=0.001)
    assert np.degrees(np.arccos(R[2, 2])) < 0.1

    # Not only similar but in place: the map's frame is the board's.
    world_T_board = np.array(yaml.safe_load((hall / "truth" / "reference_scene.yaml").read_text())["T_world_board"])
    in_world = world_T_board @ reference_map.world_T_camera
    assert np.median(np.linalg.norm(in_world[:, :3, 3] - poses[:, :3, 3], axis=1)) < 0.003
    turned = np.swapaxes(in_world[:, :3, :3], 1, 2) @ poses[:, :3, :3]
    assert np.degrees(np.median(Rotation.from_matrix(turned).magnitude())) < 0.05
