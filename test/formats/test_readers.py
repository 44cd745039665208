"""Exports in the programs that they are for: Blender, OpenSim and USD, which have environments of their own.

``make readers`` makes these and runs this; elsewhere it skips.
"""

import json
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.athletes import BALL_OF_FOOT, cyclist
from helpers.exported_files import JOINT_M, Exported, solved_ride
from helpers.known_walk import Walk, write_solved
from helpers.read_glb import ReadGlb
from helpers.rigged_character import Build, bone_names, write_character
from numpy.typing import NDArray

from bodycam_ros.body.skin import skinned_body
from bodycam_ros.environment.machines import WHEEL_M
from bodycam_ros.formats.figure import rest_pose
from bodycam_ros.formats.opensim import OPENSIM_R_OURS
from bodycam_ros.formats.sampled_motion import UP_AXES
from bodycam_ros.results.solved_body import read_solved_body

REPOSITORY = Path(__file__).parent.parent.parent
SCRIPTS = Path(__file__).parent / "readers"
MOST_S = 120.0
EVERY = 50
"""As the scripts have it: of which vertices they tell the places."""
EXACT_DEG = 0.1


@pytest.fixture(scope="module")
def exported(sample_out: Path, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    return Exported.of(sample_out, tmp_path_factory.mktemp("read"))


def read(environment: str, script: str, file: Path, *more: str) -> Any:
    """What a script of another environment says of a file."""
    python = REPOSITORY / ".venv-readers" / environment / "bin" / "python"
    if not python.exists():
        pytest.skip(f"{python.relative_to(REPOSITORY)} is not there; 'make readers' makes it")
    said = file.parent / f"{file.stem}.{script}.json"
    command = [str(python), str(SCRIPTS / script), str(file), str(said), *more]
    done = subprocess.run(command, capture_output=True, text=True, timeout=MOST_S, cwd=file.parent)
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(said.read_text())


def posed_skin(exported: Exported, pose: str) -> NDArray[np.float64]:
    """(T, V, 3) every so-manieth vertex of our skin over the frames [m]."""
    solved = read_solved_body(exported.out)
    skin = skinned_body(solved.body).rebound(rest_pose(solved.body, pose))
    return np.stack([skin.posed(poses)[::EVERY] for poses in solved.world_T_segment])


@pytest.mark.parametrize(("to", "pose"), [("bvh", "N"), ("bvh", "T"), ("glb", "A"), ("glb", "N"), ("usd", "N")])
def test_in_blender_the_body_is_upright_and_walks_where_it_walked(exported: Exported, to: str, pose: str) -> None:
    said = read("blender", "read_in_blender.py", exported.file(to, "--pose", pose, name=f"{to}{pose}"))
    assert to == "usd" or said["fps"] == pytest.approx(30.0, abs=0.01)  # of USD Blender takes the frames alone
    for segment in exported.solved.body_segments:
        np.testing.assert_allclose(said["heads"][segment], exported.places(segment), rtol=0.0, atol=JOINT_M)
    rest = said["rest"]
    assert rest["head"][2] - rest["foot_left"][2] > 1.2
    assert rest["thigh_left"][0] > rest["thigh_right"][0]  # it faces along -y, as Blender wants it
    assert (said["vertices"] > 1000) == (to != "bvh")
    if to != "bvh":
        np.testing.assert_allclose(said["skin"], posed_skin(exported, pose), rtol=0.0, atol=JOINT_M)
        assert said["bones_of_a_vertex"] == 4
        assert said["weights"] == pytest.approx([1.0, 1.0], abs=1e-5)


def test_blender_moves_the_bones_of_a_character_as_we_do(exported: Exported) -> None:
    build = Build("unreal", arms_deg=45.0, unit_m=0.01, z_up=True)
    character = write_character(build, exported.folder / "hero.glb")
    file = exported.file("glb", "--character", str(character), name="character")
    said, ours = read("blender", "read_in_blender.py", file), ReadGlb(file)
    for name in bone_names("unreal").values():
        np.testing.assert_allclose(said["heads"][name], ours.places(name), rtol=0.0, atol=JOINT_M)


def for_opensim(exported: Exported) -> Path:
    folder = exported.folder / "opensim"
    folder.mkdir()
    inside = replace(exported, folder=folder)
    for to in ("mot", "trc"):
        inside.file(to)
    return folder


def test_opensim_finds_the_angles_across_a_gap(walk: Walk, tmp_path: Path) -> None:
    out = write_solved(walk.without(list(range(20, 30))), tmp_path / "out")
    said = read("readers", "read_in_opensim.py", for_opensim(Exported.of(out, tmp_path)))
    for name, values in said["analysed"]["columns"].items():
        assert len(values) == 60
        np.testing.assert_allclose(said["inverse"]["columns"][name], values, rtol=0.0, atol=EXACT_DEG, err_msg=name)


def test_opensim_has_our_joint_angles_and_finds_them_from_the_markers(exported: Exported) -> None:
    said = read("readers", "read_in_opensim.py", for_opensim(exported))
    for segment in exported.solved.body_segments:
        ours = exported.places(segment) @ OPENSIM_R_OURS.T
        np.testing.assert_allclose(said["moved"]["bodies"][segment], ours, rtol=0.0, atol=JOINT_M)
    assert 50.0 < said["moved"]["mass"] < 110.0
    motion = exported.solved
    for of in ("analysed", "inverse"):
        assert said[of]["inDegrees"] == "yes"
        np.testing.assert_allclose(said[of]["times"], exported.seconds, atol=1e-6)
        for name, angles in zip(motion.joint_names, np.degrees(motion.joint_angles).T, strict=True):
            np.testing.assert_allclose(said[of]["columns"][name], angles, rtol=0.0, atol=EXACT_DEG, err_msg=name)


def test_usd_moves_its_joints_and_its_skin(exported: Exported) -> None:
    said = read("readers", "read_in_usd.py", exported.file("usd"))
    assert (said["up"], said["metres"], said["fps"]) == ("Z", 1.0, pytest.approx(30.0, abs=1e-4))
    for segment in exported.solved.body_segments:
        np.testing.assert_allclose(said["heads"][segment], exported.places(segment), rtol=0.0, atol=JOINT_M)
    np.testing.assert_allclose(said["skins"], posed_skin(exported, "N"), rtol=0.0, atol=JOINT_M)
    assert said["bones_of_a_vertex"] == 4


@pytest.mark.parametrize(("up", "scale"), [("z", 1.0), ("y", 100.0)])
def test_usd_has_a_ride_on_a_road(up: str, scale: float, tmp_path: Path) -> None:
    ride = solved_ride(cyclist(1.0), tmp_path)
    file = ride.file("usd", "--environment", "road", "--travel", "6", "--up", up, "--scale", str(scale))
    said = read("readers", "read_in_usd.py", file)
    ours_R = UP_AXES[up].T
    seconds = ride.seconds

    def poses(name: str) -> NDArray[np.float64]:
        matrices = np.array(said["objects"][name]).transpose(0, 2, 1)
        matrices[:, :3, 3] = matrices[:, :3, 3] @ ours_R.T / scale
        matrices[:, :3, :3] = ours_R @ matrices[:, :3, :3] @ ours_R.T
        return matrices

    frame, wheel = poses("frame"), poses("frame_wheel_1")
    np.testing.assert_allclose(frame[:, 0, 3] - frame[0, 0, 3], 6.0 * seconds, atol=JOINT_M)
    ahead = (wheel[0, :3, :3].T @ wheel[:, :3, :3])[:, [2, 0], [0, 0]]  # about y: the spoke ahead goes down
    rolled = np.unwrap(np.arctan2(-ahead[:, 0], ahead[:, 1]))
    np.testing.assert_allclose(rolled, 6.0 * seconds / WHEEL_M, atol=1e-3)
    foot = np.array(said["heads"]["foot_left"]) @ ours_R.T / scale
    pedal = poses("pedal_left")[:, :3, 3]
    ankle_m = np.linalg.norm(BALL_OF_FOOT)
    np.testing.assert_allclose(np.linalg.norm(foot - pedal, axis=1), ankle_m, atol=5 * JOINT_M)
    np.testing.assert_allclose((np.array(said["ground"]) @ ours_R.T)[:, 2], 0.0, atol=1e-6)
    assert said["materials"][0].endswith("/materials/skin")
    assert all("/materials/c_" in each for each in said["materials"][1:])
