from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from helpers.known_walk import walking_body
from numpy.typing import NDArray

from bodycam_ros.body.average_person import stature_of
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.limb_mesh import capsule_surfaces
from bodycam_ros.body.skin import SkinnedSurface, skinned_body
from bodycam_ros.body.surface import Surface
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import exp_so3, inverse, rigid, transform_points

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def body(sample: Path) -> BodyModel:
    return read_body(sample / "body.yaml")


@pytest.fixture(scope="module")
def skin(body: BodyModel) -> SkinnedSurface:
    """With the N-pose as its rest pose, from which limbs bend most."""
    return skinned_body(body).rebound(body.n_pose(np.eye(4)))


def bent(body: BodyModel, poses: Array, segment: str, degrees: float) -> Array:
    """A segment and all below it, turned about y, the axis of knees and elbows in the N-pose."""
    origin = rigid(np.eye(3), poses[body.segment_index[segment], :3, 3])
    turn = origin @ rigid(exp_so3(np.radians([0.0, degrees, 0.0])), np.zeros(3)) @ inverse(origin)
    below = body.rows_below.get(body.segment_index[segment], [body.segment_index[segment]])
    turned = poses.copy()
    turned[below] = turn @ poses[below]
    return turned


def ring_length(skin: SkinnedSurface, posed: Array, origin: Array, normal: Array, cut: Array) -> float:
    """Length of the posed skin's section by a plane, or of where the triangles of such a section of ``cut`` went."""
    mesh = trimesh.Trimesh(cut, skin.triangles, process=False)
    lines, faces = trimesh.intersections.mesh_plane(mesh, normal, origin, return_faces=True)
    around = np.linalg.norm(lines.mean(axis=1) - origin, axis=1) < 0.12
    ends = []
    for end in (0, 1):
        shares = trimesh.triangles.points_to_barycentric(cut[skin.triangles[faces[around]]], lines[around, end])
        ends.append(np.einsum("nk,nki->ni", shares, posed[skin.triangles[faces[around]]]))
    return float(np.linalg.norm(ends[0] - ends[1], axis=1).sum())


def test_the_skin_is_closed_and_one(skin: SkinnedSurface) -> None:
    mesh = trimesh.Trimesh(skin.vertices, skin.triangles, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.body_count == 1
    assert 60.0 < 1000.0 * mesh.volume < 90.0  # litres; of 1.74 m, 73 kg is usual


def test_weights_of_four_bones_at_most_sum_to_one(skin: SkinnedSurface, body: BodyModel) -> None:
    assert skin.weights.shape == skin.joints.shape == (len(skin.vertices), 4)
    assert skin.weights.min() >= 0.0
    np.testing.assert_allclose(skin.weights.sum(axis=1), 1.0, rtol=0.0, atol=1e-12)
    assert len(skin.halves) == len(body.tree_joints)
    used = set(skin.joints[skin.weights > 0.0].tolist())
    assert used | {body.segment_index["pelvis"]} == set(range(len(body.segments) + len(skin.halves)))


def test_a_skin_moves_rigidly_with_a_body_that_does(skin: SkinnedSurface) -> None:
    world_T_root = rigid(exp_so3(np.array([0.3, -1.0, 2.0])), np.array([3.0, -2.0, 1.0]))
    np.testing.assert_allclose(skin.posed(skin.rest), skin.vertices, rtol=0.0, atol=1e-12)
    moved = transform_points(world_T_root, skin.vertices)
    np.testing.assert_allclose(skin.posed(world_T_root @ skin.rest), moved, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("segment", "degrees"),
    [("shin_left", 120.0), ("shin_right", 120.0), ("forearm_left", -120.0), ("forearm_right", -120.0)],
)
def test_knees_and_elbows_keep_their_girth(skin: SkinnedSurface, body: BodyModel, segment: str, degrees: float) -> None:
    poses = bent(body, skin.rest, segment, degrees)
    posed = skin.posed(poses)
    joint = skin.rest[body.segment_index[segment], :3, 3]
    for below in np.arange(-0.1, 0.11, 0.02):
        origin, normal = joint - [0.0, 0.0, below], np.array([0.0, 0.0, 1.0])
        rest = ring_length(skin, skin.vertices, origin, normal, skin.vertices)
        assert ring_length(skin, posed, origin, normal, skin.vertices) > 0.9 * rest
    # Section by the plane that halves the angle.
    halving = exp_so3(np.radians([0.0, 0.5 * degrees, 0.0])) @ [0.0, 0.0, 1.0]
    rest = ring_length(skin, skin.vertices, joint, np.array([0.0, 0.0, 1.0]), skin.vertices)
    assert ring_length(skin, posed, joint, halving, posed) > 0.9 * rest
    assert not inverted(skin, poses).any()


def inverted(skin: SkinnedSurface, poses: Array) -> NDArray[np.bool_]:
    """Which triangles face against where their bones turned them."""
    turned = skin.bone_poses(poses)[:, :3, :3] @ np.swapaxes(skin.bone_poses(skin.rest)[:, :3, :3], -1, -2)
    turn = np.einsum("vb,vbij->vij", skin.weights, turned[skin.joints])[skin.triangles].mean(axis=1)
    before = trimesh.Trimesh(skin.vertices, skin.triangles, process=False)
    after = trimesh.Trimesh(skin.posed(poses), skin.triangles, process=False)
    expected = np.einsum("tij,tj->ti", turn, before.triangles_cross)
    bad: NDArray[np.bool_] = np.sum(expected * after.triangles_cross, axis=1) <= 0.0
    return bad


def test_without_half_bones_a_knee_collapses(skin: SkinnedSurface, body: BodyModel) -> None:
    """The measure of the test above tells: shared by two segments alone, a knee loses a fifth of its girth."""
    bones = skin.joints.copy()
    weights = np.zeros((len(bones), len(body.segments)))
    for column in range(bones.shape[1]):
        half = bones[:, column] >= len(body.segments)
        pairs = skin.halves[np.where(half, bones[:, column] - len(body.segments), 0)]
        ends = np.where(half[:, None], pairs, bones[:, [column, column]])
        np.add.at(weights, (np.arange(len(bones))[:, None], ends), 0.5 * skin.weights[:, [column, column]])
    order = np.argsort(-weights, axis=1)[:, :4]
    plain = SkinnedSurface(
        skin.vertices, skin.triangles, order, np.take_along_axis(weights, order, axis=1), skin.rest, skin.neutral,
        skin.halves,
    )  # fmt: skip
    joint, up = skin.rest[body.segment_index["shin_left"], :3, 3], np.array([0.0, 0.0, 1.0])
    posed = plain.posed(bent(body, skin.rest, "shin_left", 120.0))
    assert ring_length(plain, posed, joint, up, skin.vertices) < 0.85 * ring_length(
        skin, skin.vertices, joint, up, skin.vertices
    )


@pytest.mark.parametrize("girth", [0.7, 1.4])
def test_girths_and_stature_are_in_the_skin(body: BodyModel, girth: float) -> None:
    """In the middle of a thigh the section is as long as the table of people says, times the girth."""
    skin = skinned_body(replace(body, girths={"thigh_left": girth}))
    pose = skin.rest[body.segment_index["thigh_left"]]
    origin = transform_points(pose, np.array([[0.0, 0.0, -0.5 * 0.4255]]))[0]
    length = ring_length(skin, skin.vertices, origin, pose[:3, 2], skin.vertices)
    share = 0.332 + (0.212 - 0.332) * (0.5 - 0.2) / 0.8
    assert length == pytest.approx(girth * share * stature_of(body), rel=0.03)


def test_a_body_of_other_segments_has_a_skin() -> None:
    skin = skinned_body(walking_body())
    mesh = trimesh.Trimesh(skin.vertices, skin.triangles, process=False)
    assert mesh.is_watertight
    np.testing.assert_allclose(skin.weights.sum(axis=1), 1.0, rtol=0.0, atol=1e-12)


def test_bones_of_many_poses_are_those_of_each(skin: SkinnedSurface, body: BodyModel) -> None:
    poses = np.stack([bent(body, skin.rest, "shin_left", degrees) for degrees in (0.0, 30.0, 90.0)])
    each = np.stack([skin.bone_poses(pose) for pose in poses])
    np.testing.assert_allclose(skin.bone_poses(poses), each, rtol=0.0, atol=1e-12)


def test_a_scan_is_the_skin(body: BodyModel) -> None:
    """A scanned head of twice the size, and all else as capsules."""
    head = capsule_surfaces(body)["head"]
    scan = skinned_body(body, {"head": Surface(2.0 * head.vertices, head.faces)})
    mesh = trimesh.Trimesh(scan.vertices, scan.triangles, process=False)
    assert mesh.is_watertight and mesh.body_count == 1
    np.testing.assert_allclose(scan.weights.sum(axis=1), 1.0, rtol=0.0, atol=1e-12)
    grown = np.ptp(scan.vertices[:, 2]) - np.ptp(skinned_body(body).vertices[:, 2])
    assert grown == pytest.approx(head.vertices[:, 2].max(), abs=0.01)


def test_a_scan_bends_without_inverted_triangles(body: BodyModel) -> None:
    scan = skinned_body(body, capsule_surfaces(body)).rebound(body.n_pose(np.eye(4)))
    for segment, degrees in (("shin_left", 120.0), ("forearm_left", -120.0)):
        assert not inverted(scan, bent(body, scan.rest, segment, degrees)).any()


def test_a_scan_with_a_hole_is_refused_by_name(body: BodyModel) -> None:
    head = capsule_surfaces(body)["head"]
    with pytest.raises(BodyError, match="surface of head is not closed"):
        skinned_body(body, {"head": Surface(head.vertices, head.faces[:-3])})
