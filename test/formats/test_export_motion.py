"""bodycam export of motion: every format read back by a reader of others, with the joints where OUT has them."""

import re
from pathlib import Path

import c3d
import ezc3d
import numpy as np
import pinocchio
import pybvh
import pygltflib
import pytest
import trimesh
from helpers.exported_files import JOINT_M, Exported
from helpers.known_walk import Walk, write_solved
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bodycam_ros.body.limb_mesh import capsule_surfaces
from bodycam_ros.body.skin import skinned_body
from bodycam_ros.cli.main import main
from bodycam_ros.formats.figure import BONE_NAMES, bone_names, rest_pose
from bodycam_ros.formats.sampled_motion import UP_AXES
from bodycam_ros.results.solved_body import read_solved_body

PEOPLE = ("pelvis", "torso", "head", "upper_arm_left", "forearm_left", "thigh_right", "shin_right", "foot_right")


@pytest.fixture(scope="module")
def sample_exported(sample_out: Path, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    return Exported.of(sample_out, tmp_path_factory.mktemp("exported"))


@pytest.fixture(scope="module")
def walked(walk: Walk, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    folder = tmp_path_factory.mktemp("walked")
    return Exported.of(write_solved(walk, folder / "out"), folder)


@pytest.mark.parametrize("pose", ["N", "T", "A"])
@pytest.mark.parametrize(("up", "scale"), [("y", 1.0), ("z", 100.0)])
def test_bvh_has_the_joints_where_they_were(sample_exported: Exported, pose: str, up: str, scale: float) -> None:
    flags = ("--pose", pose, "--up", up, "--scale", str(scale), "--force")
    read = pybvh.read_bvh_file(sample_exported.file("bvh", *flags))
    assert read.frame_time == pytest.approx(1.0 / 30.0, abs=1e-7) and str(read.rest_up)[-1].lower() == up
    positions = read.joint_positions()
    assert len(read.joint_names) == len(sample_exported.solved.body_segments)
    for column, segment in enumerate(read.joint_names):
        ours = sample_exported.places(segment) @ UP_AXES[up].T
        np.testing.assert_allclose(positions[:, column] / scale, ours, rtol=0.0, atol=JOINT_M / 50.0)


@pytest.mark.parametrize(("up", "scale"), [("y", 1.0), ("z", 100.0)])
def test_usd_tells_its_readers_which_axis_is_up_and_its_unit(sample_exported: Exported, up: str, scale: float) -> None:
    text = sample_exported.file("usd", "--up", up, "--scale", str(scale), "--force").read_text()
    assert f'upAxis = "{up.upper()}"' in text and f"metersPerUnit = {1.0 / scale:g}" in text
    samples = re.search(r"translations\.timeSamples = \{\s*0: \[\(([^)]*)\)", text)
    assert samples is not None
    root = np.array([float(each) for each in samples[1].split(",")])
    ours = sample_exported.places("pelvis")[0] @ UP_AXES[up].T
    np.testing.assert_allclose(root / scale, ours, rtol=0.0, atol=JOINT_M / 10.0)


def rest_places(file: Path) -> dict[str, NDArray[np.float64]]:
    read = pybvh.read_bvh_file(file)
    return dict(zip((node.name for node in read.nodes), read.rest_pose_positions(), strict=True))


@pytest.mark.parametrize(("pose", "raised"), [("N", 0.0), ("A", 45.0), ("T", 90.0)])
def test_in_the_rest_pose_the_body_faces_its_viewer_and_arms_are_raised(
    sample_exported: Exported, pose: str, raised: float
) -> None:
    rest = rest_places(sample_exported.file("bvh", "--pose", pose, name=pose))
    for side, outward in (("left", 1.0), ("right", -1.0)):
        x, y, z = rest[f"forearm_{side}"] - rest[f"upper_arm_{side}"]
        assert np.degrees(np.arctan2(outward * x, -y)) == pytest.approx(raised, abs=1.5)
        assert abs(z) < 0.01
        assert outward * rest[f"thigh_{side}"][0] > 0.05  # its left is along x: it faces along z
        assert rest[f"shin_{side}"][1] < rest[f"thigh_{side}"][1] - 0.3


def test_angles_of_a_bvh_never_jump(walk: Walk, tmp_path: Path) -> None:
    """Over whole turns of the body, a hip bent by more than a right angle, and another started at one."""
    turns = 2.0 * np.pi * np.linspace(0.0, 3.0, len(walk.stamps_ns))
    turned = np.tile(np.eye(4), (len(turns), 1, 1))
    turned[:, :2, :2] = np.stack([[np.cos(turns), -np.sin(turns)], [np.sin(turns), np.cos(turns)]]).transpose(2, 0, 1)
    moved = Walk(walk.body, walk.stamps_ns, turned[:, None] @ walk.world_T_segment)
    moved = moved.bent("hip_left", -130.0 * np.sin(turns / 12.0)).bent("knee_left", 100.0 * np.sin(turns / 12.0))
    exported = Exported.of(write_solved(moved, tmp_path / "out"), tmp_path)
    file = exported.file("bvh")
    rows = file.read_text().split("Frame Time:")[1].splitlines()[1:]
    angles = np.array([[float(number) for number in row.split()] for row in rows])[:, 3:]
    fastest = 2.0 * np.degrees(np.diff(turns)[0])  # the root's own turning is the quickest there is
    assert np.abs(np.diff(angles, axis=0)).max() < fastest
    assert np.ptp(angles[:, 0]) > 1000.0
    read = pybvh.read_bvh_file(file)
    for column, segment in enumerate(read.joint_names):
        ours = exported.places(segment) @ UP_AXES["y"].T
        np.testing.assert_allclose(read.joint_positions()[:, column], ours, rtol=0.0, atol=JOINT_M / 50.0)


@pytest.mark.parametrize(
    ("convention", "expected"),
    [
        ("blender", ("hips", "upper_arm.L", "shin.R")),
        ("mixamo", ("mixamorig:Hips", "mixamorig:LeftArm", "mixamorig:RightLeg")),
        ("cmu", ("root", "lhumerus", "rtibia")),
        ("unreal", ("pelvis", "upperarm_l", "calf_r")),
    ],
)
def test_bones_have_the_names_of_other_programs(
    sample_exported: Exported, convention: str, expected: tuple[str, ...]
) -> None:
    assert bone_names(("pelvis", "upper_arm_left", "shin_right"), convention) == expected
    read = pybvh.read_bvh_file(sample_exported.file("bvh", "--names", convention, "--force"))
    assert set(expected) < set(read.joint_names)
    assert not set(read.joint_names) & {"torso", "thigh_left"}
    assert set(BONE_NAMES) == {"blender", "mixamo", "cmu", "unreal"}


def test_a_segment_of_no_table_keeps_its_name_in_one_word() -> None:
    assert bone_names(("tail", "left horn", "torso"), "cmu") == ("tail", "left_horn", "lowerback")


@pytest.mark.parametrize("up", ["y", "z"])
def test_c3d_has_the_joints_where_they_were(sample_exported: Exported, up: str) -> None:
    read = ezc3d.c3d(str(sample_exported.file("c3d", "--up", up, "--force")))
    points, labels = read["data"]["points"], read["parameters"]["POINT"]["LABELS"]["value"]
    assert read["parameters"]["POINT"]["UNITS"]["value"] == ["mm"]
    assert read["header"]["points"]["frame_rate"] == pytest.approx(30.0, abs=1e-4)
    assert read["parameters"]["POINT"]["Y_SCREEN"]["value"] == [f"+{up.upper()}"]
    for label, segment in {
        "pelvis": "pelvis",
        "neck": "head",
        "knee_left": "shin_left",
        "ankle_right": "foot_right",
    }.items():
        ours = sample_exported.places(segment) @ UP_AXES[up].T
        np.testing.assert_allclose(points[:3, labels.index(label)].T / 1000.0, ours, rtol=0.0, atol=JOINT_M / 50.0)


@pytest.mark.filterwarnings("ignore:No analog data")
def test_another_reader_of_c3d_than_its_writer_sees_the_same(walked: Exported) -> None:
    file = walked.file("c3d", "--rate", "60")
    written = ezc3d.c3d(str(file))
    with file.open("rb") as stream:
        reader = c3d.Reader(stream)
        frames = np.array([points[:, :3] for _, points, _ in reader.read_frames()])
        assert reader.point_rate == 60.0
    labels = [label.strip() for label in reader.point_labels]
    assert labels == written["parameters"]["POINT"]["LABELS"]["value"]
    np.testing.assert_allclose(frames.transpose(2, 1, 0), written["data"]["points"][:3], atol=1e-3)
    np.testing.assert_allclose(
        frames[::2, labels.index("ankle_left")] / 1000.0, walked.places("foot_left"), rtol=0.0, atol=JOINT_M / 50.0
    )


def trc_markers(file: Path) -> tuple[list[str], NDArray[np.float64]]:
    """Names and (T, 2 + 3 M) numbers."""
    return file.read_text().splitlines()[3].split("\t")[2::3], np.loadtxt(file, skiprows=6)


def test_trc_has_the_joints_where_they_were(sample_exported: Exported) -> None:
    names, rows = trc_markers(sample_exported.file("trc"))
    assert (sample_exported.folder / "motion.osim").read_text().startswith("<?xml")
    np.testing.assert_allclose(rows[:, 1], sample_exported.seconds, atol=1e-8)
    for name, segment in {"pelvis": "pelvis", "elbow_left": "forearm_left"}.items():
        column = 2 + 3 * names.index(name)
        ours = sample_exported.places(segment) @ UP_AXES["y"].T
        np.testing.assert_allclose(rows[:, column : column + 3] / 1000.0, ours, rtol=0.0, atol=JOINT_M / 50.0)


def node_matrices(read: pygltflib.GLTF2, frame: int) -> dict[str, NDArray[np.float64]]:
    """Node -> world matrix at a key of the animation, as the standard has it."""
    parents = {child: row for row, node in enumerate(read.nodes) for child in node.children or ()}
    poses = [
        (np.array(node.translation or (0.0, 0.0, 0.0)), np.array(node.rotation or (0.0, 0.0, 0.0, 1.0)))
        for node in read.nodes
    ]
    animation = read.animations[0]
    for channel in animation.channels:
        value = accessor(read, animation.samplers[channel.sampler].output)[frame]
        place, turn = poses[channel.target.node]
        poses[channel.target.node] = (value, turn) if channel.target.path == "translation" else (place, value)

    def world(row: int) -> NDArray[np.float64]:
        local = np.eye(4)
        local[:3, 3], local[:3, :3] = poses[row][0], Rotation.from_quat(poses[row][1]).as_matrix()
        return world(parents[row]) @ local if row in parents else local

    return {node.name: world(row) for row, node in enumerate(read.nodes)}


def accessor(read: pygltflib.GLTF2, row: int) -> NDArray[np.float64]:
    held = read.accessors[row]
    view = read.bufferViews[held.bufferView]
    kind = {5126: "<f4", 5121: "u1", 5125: "<u4"}[held.componentType]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[held.type]
    data = read.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
    return np.frombuffer(data, kind).reshape(held.count, width).astype(np.float64)


def test_gltf_moves_its_bones_and_its_skin(sample_exported: Exported) -> None:
    read = pygltflib.GLTF2().load(str(sample_exported.file("glb", "--pose", "T")))
    times = accessor(read, read.animations[0].samplers[0].input)[:, 0]
    np.testing.assert_allclose(times, sample_exported.seconds, atol=1e-6)
    bind = accessor(read, read.skins[0].inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
    skin = read.meshes[0].primitives[0].attributes
    vertices, bones = accessor(read, skin.POSITION), accessor(read, skin.JOINTS_0).astype(int)
    weights = accessor(read, skin.WEIGHTS_0)
    assert bones.shape == weights.shape == (len(vertices), 4)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=0.0, atol=1e-6)
    assert vertices[:, 1].min() == pytest.approx(0.0, abs=1e-6)  # it stands on the ground
    assert 1.6 < np.ptp(vertices[:, 1]) < 1.9 and np.ptp(vertices[:, 0]) > 1.2  # arms out
    solved = read_solved_body(sample_exported.out)
    ours_skin = skinned_body(solved.body).rebound(rest_pose(solved.body, "T"))
    for frame in (0, 29, 59):
        poses = node_matrices(read, frame)
        for segment in PEOPLE:
            ours = UP_AXES["y"] @ sample_exported.places(segment)[frame]
            np.testing.assert_allclose(poses[segment][:3, 3], ours, rtol=0.0, atol=JOINT_M / 50.0)
        joints = np.stack([poses[read.nodes[node].name] for node in read.skins[0].joints])
        each = np.einsum("vbij,vj->vbi", (joints @ bind)[bones], np.column_stack([vertices, np.ones(len(vertices))]))
        moved = np.einsum("vb,vbi->vi", weights, each)[:, :3]
        posed = ours_skin.posed(solved.world_T_segment[frame]) @ UP_AXES["y"].T
        np.testing.assert_allclose(moved, posed, rtol=0.0, atol=JOINT_M / 50.0)
        assert -0.05 < moved[:, 1].min() < 0.1  # feet near the floor of the world


def test_csv_tum_and_npz_say_what_out_says(sample_exported: Exported) -> None:
    solved = sample_exported.solved
    table = np.genfromtxt(sample_exported.file("csv"), delimiter=",", names=True)
    place = np.column_stack([table[f"foot_left_{axis}_m"] for axis in "xyz"])
    np.testing.assert_allclose(place, sample_exported.places("foot_left"), rtol=0.0, atol=1e-6)
    knee = solved.joint_angles[:, solved.joint_names.index("knee_left_y")]
    np.testing.assert_allclose(table["knee_left_y_deg"], np.degrees(knee), rtol=0.0, atol=1e-5)

    poses = solved.world_T_link["head"]
    head = np.loadtxt(sample_exported.file("tum", "--segment", "head", name="head"))
    np.testing.assert_allclose(head[:, 1:4], poses[:, :3, 3], atol=1e-6)
    np.testing.assert_allclose(Rotation.from_quat(head[:, 4:]).as_matrix(), poses[:, :3, :3], atol=1e-6)
    stamps = [line.split()[0] for line in (sample_exported.folder / "head.tum").read_text().splitlines()[1:]]
    assert [int(stamp.replace(".", "")) for stamp in stamps] == solved.stamps_ns.tolist()
    lens = np.loadtxt(sample_exported.file("tum", "--segment", "waist_front", name="lens"))
    np.testing.assert_allclose(lens[:, 1:4], solved.world_T_link["waist_front_optical_frame"][:, :3, 3], atol=1e-6)

    with np.load(sample_exported.file("npz")) as arrays:
        assert arrays["angle_names"].tolist() == list(solved.joint_names)
        np.testing.assert_array_equal(arrays["angles"], solved.joint_angles)
        for column, segment in enumerate(arrays["segments"].tolist()):
            np.testing.assert_allclose(arrays["world_T_segment"][:, column], solved.world_T_link[segment], atol=1e-9)
        assert arrays["known"].all() and arrays["parents"][0] == -1


def test_pinocchio_moves_the_exported_urdf_to_where_the_exported_angles_have_it(sample_exported: Exported) -> None:
    model = pinocchio.buildModelFromUrdf(
        str(sample_exported.file("urdf", name="body")), pinocchio.JointModelFreeFlyer()
    )
    data = model.createData()
    with np.load(sample_exported.file("npz", name="angles")) as arrays:
        root, angles = arrays["world_T_segment"][:, 0], arrays["angles"]
        column = {name: row for row, name in enumerate(arrays["angle_names"].tolist())}
    ours = [column[name] for name in list(model.names)[2:]]
    for instant in (0, 30, 59):
        place = np.concatenate([root[instant, :3, 3], Rotation.from_matrix(root[instant, :3, :3]).as_quat()])
        pinocchio.framesForwardKinematics(model, data, np.concatenate([place, angles[instant, ours]]))
        for segment in sample_exported.solved.body_segments:
            found = data.oMf[model.getFrameId(segment)].translation
            np.testing.assert_allclose(found, sample_exported.places(segment)[instant], rtol=0.0, atol=JOINT_M / 50.0)


def test_tum_of_all_segments_is_a_file_each(walked: Exported) -> None:
    walked.file("tum", "--segment", "all", name="ways")
    files = sorted(file.name for file in walked.folder.glob("ways*"))
    assert files == ["ways.foot_left.tum", "ways.shin_left.tum", "ways.thigh_left.tum", "ways.torso.tum", "ways.tum"]
    foot = np.loadtxt(walked.folder / "ways.foot_left.tum")
    np.testing.assert_allclose(foot[:, 1:4], walked.places("foot_left"), atol=1e-6)


def test_ply_has_landmarks_and_ways(walked: Exported) -> None:
    cloud = trimesh.load(walked.file("ply"))
    assert isinstance(cloud, trimesh.PointCloud)
    grey = (cloud.colors[:, :3] == 150).all(axis=1)
    seen = {i for matches in walked.solved.landmarks(["waist", "shin"]) for i in matches.landmark_ids.tolist()}
    assert int(grey.sum()) == len(seen) > 0
    ways = cloud.vertices[~grey].reshape(-1, len(walked.seconds), 3)
    for way, segment in zip(ways, walked.solved.body_segments, strict=True):
        np.testing.assert_allclose(way, walked.places(segment), atol=1e-6)


def test_several_recordings_are_a_file_each(walked: Exported, walk: Walk, tmp_path: Path) -> None:
    (tmp_path / "second").mkdir()
    other = write_solved(walk.without(list(range(30))), tmp_path / "second" / "out")
    arguments = ["export", str(walked.out), str(other), "--to", "trc", "-o", str(tmp_path / "all")]
    assert main(arguments) == 0
    first = f"{walked.out.parent.name}_out"
    expected = [f"{first}.osim", f"{first}.trc", "second_out.osim", "second_out.trc"]
    assert sorted(file.name for file in (tmp_path / "all").iterdir()) == sorted(expected)
    assert len(trc_markers(tmp_path / "all" / "second_out.trc")[1]) == 30
    assert main(arguments) == 1
    assert main([*arguments, "--force"]) == 0


def test_a_scan_is_the_skin_of_a_glb(
    sample_exported: Exported, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    head = capsule_surfaces(read_solved_body(sample_exported.out).body)["head"]
    trimesh.Trimesh(head.vertices * [1.0, 1.0, 1.5], head.faces, process=False).export(tmp_path / "head.obj")
    own = pygltflib.GLTF2().load(str(sample_exported.file("glb", "--pose", "T", name="own")))
    scanned = pygltflib.GLTF2().load(
        str(sample_exported.file("glb", "--pose", "T", "--surface", str(tmp_path), name="scanned"))
    )
    tall = [accessor(read, read.meshes[0].primitives[0].attributes.POSITION)[:, 1].max() for read in (own, scanned)]
    assert tall[1] - tall[0] == pytest.approx(0.5 * head.vertices[:, 2].max(), abs=0.01)
    trimesh.Trimesh(head.vertices, head.faces[:-3], process=False).export(tmp_path / "head.obj")
    output = sample_exported.folder / "open.glb"
    command = ["export", str(sample_exported.out), "--to", "glb", "--surface", str(tmp_path), "-o", str(output)]
    assert main(command) == 1
    assert f"{tmp_path}: the surface of head is not closed" in " ".join(capsys.readouterr().err.split())
    assert not output.exists()
