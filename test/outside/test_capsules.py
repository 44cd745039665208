from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint import Joint
from bodycam_ros.equipment.coupled_body import coupled_body, held_equipment
from bodycam_ros.geometry import rigid
from bodycam_ros.outside.capsules import capsule_surfaces
from bodycam_ros.outside.girths import stature_of
from bodycam_ros.outside.surface import OPEN
from bodycam_ros.outside.surface_folder import read_surfaces


@pytest.fixture(scope="module")
def body(sample: Path) -> BodyModel:
    return read_body(sample / "body.yaml")


def joint(name: str, parent: str, child: str, at: tuple[float, float, float]) -> Joint:
    return Joint(name, parent, child, "ball", rigid(np.eye(3), np.array(at)))


def scaled(body: BodyModel, factor: float) -> BodyModel:
    joints = []
    for one in body.joints:
        parent_T_joint = one.parent_T_joint.copy()
        parent_T_joint[:3, 3] *= factor
        joints.append(Joint(one.name, one.parent, one.child, "ball", parent_T_joint))
    return BodyModel(body.name, body.root, body.segments, tuple(joints), {})


def test_every_segment_of_a_person_has_a_closed_surface(body: BodyModel) -> None:
    surfaces = capsule_surfaces(body)
    assert tuple(surfaces) == body.segments
    for segment, surface in surfaces.items():
        assert surface.segment == segment
        assert (surface.edge_faces != OPEN).all()
        for part in trimesh.Trimesh(surface.vertices, surface.faces, process=False).split():
            assert part.volume > 0.0


def test_the_body_weighs_what_a_person_does(body: BodyModel) -> None:
    """Hands aside, and the density of the body that of water; parts overlap at the joints and within the trunk."""
    volumes = [
        trimesh.boolean.union(trimesh.Trimesh(s.vertices, s.faces, process=False).split(), engine="manifold").volume
        for s in capsule_surfaces(body).values()
    ]
    assert 60.0 < 1000.0 * sum(volumes) < 100.0  # litres; of 1.74 m, 73 kg is usual


def test_it_grows_with_the_bones(body: BodyModel) -> None:
    child = scaled(body, 0.7)
    assert stature_of(child) == pytest.approx(0.7 * stature_of(body))
    for segment, surface in capsule_surfaces(child).items():
        grown = 0.7 * np.ptp(capsule_surfaces(body)[segment].vertices, axis=0)
        np.testing.assert_allclose(np.ptp(surface.vertices, axis=0), grown, rtol=0.02)


def test_it_reaches_from_joint_to_joint(body: BodyModel) -> None:
    surfaces = capsule_surfaces(body)
    for one in body.tree_joints:
        vertices = surfaces[one.parent].vertices
        inside = trimesh.Trimesh(vertices, surfaces[one.parent].faces, process=False)
        # The shoulders are at the ends of their bar, all other joints inside.
        assert trimesh.proximity.signed_distance(inside, [one.parent_T_joint[:3, 3]])[0] > -0.01, one.name
    shoulders = [one.parent_T_joint[1, 3] for one in body.joints if one.name.startswith("shoulder")]
    assert np.ptp(surfaces["torso"].vertices[:, 1]) == pytest.approx(max(shoulders) - min(shoulders), rel=0.01)
    assert surfaces["head"].vertices[:, 2].max() == pytest.approx(0.14 * stature_of(body), rel=0.01)
    foot = surfaces["foot_left"].vertices
    assert foot[:, 0].max() > 3.0 * -foot[:, 0].min() and foot[:, 2].max() < 0.02


def test_other_bodies_have_a_capsule_along_each_bone() -> None:
    joints = (joint("a", "trunk", "left", (0, 0.4, 0)), joint("b", "trunk", "right", (0, -0.2, 0)))
    surfaces = capsule_surfaces(BodyModel("robot", "trunk", ("trunk", "left", "right"), joints, {}))
    assert tuple(surfaces) == ("trunk",)  # nobody knows where the others end
    np.testing.assert_allclose(surfaces["trunk"].vertices.min(axis=0), [-0.06, -0.23, -0.06], atol=2e-3)
    np.testing.assert_allclose(surfaces["trunk"].vertices.max(axis=0), [0.06, 0.46, 0.06], atol=2e-3)


def test_a_person_with_joints_missing_or_in_one_place_has_a_surface() -> None:
    joints = (
        joint("hip_left", "pelvis", "thigh_left", (0, 0.1, 0)),
        joint("hip_right", "pelvis", "thigh_right", (0, 0.1, 0)),
        joint("spine", "pelvis", "torso", (0, 0, 0)),
        joint("knee", "thigh_left", "shin_left", (0, 0, 0)),
    )
    segments = ("pelvis", "thigh_left", "thigh_right", "torso", "shin_left")
    surfaces = capsule_surfaces(BodyModel("odd", "pelvis", segments, joints, {}))
    assert set(surfaces) == {"pelvis", "thigh_left", "thigh_right", "shin_left"}
    assert all(np.isfinite(surface.vertices).all() for surface in surfaces.values())
    assert surfaces["thigh_left"].vertices[:, 2].min() < -0.4


def test_equipment_has_none(body: BodyModel) -> None:
    both = coupled_body(body, held_equipment("bicycle", body))
    assert capsule_surfaces(both).keys() == capsule_surfaces(body).keys()


def test_capsules_are_near_the_scan_of_that_person(shared: Path, body: BodyModel) -> None:
    scans = shared / "dev_outside_cycle" / "body"
    if not scans.is_dir():
        pytest.skip("the recording with static cameras (../shared/recordings/dev_outside_cycle) is not on this machine")
    capsules = capsule_surfaces(body)
    for segment, scan in read_surfaces(scans, body).items():
        mesh = capsules[segment]
        points, _ = trimesh.sample.sample_surface(trimesh.Trimesh(mesh.vertices, mesh.faces), 5000, seed=0)
        off, _ = cKDTree(points).query(scan.vertices)
        assert np.median(off) < 0.03, segment
