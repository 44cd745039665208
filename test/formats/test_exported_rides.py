"""Rides as glb and usd, in places that were not there, read back: what touches what, and how fast it goes."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from helpers.athletes import AIRBORNE_S, cyclist, snowboarder
from helpers.exported_files import Exported, solved_ride
from helpers.read_glb import OURS_R_SCENE, ReadGlb
from numpy.typing import NDArray

from bodycam_ros.cli.main import main
from bodycam_ros.environment.machines import WHEEL_M
from bodycam_ros.geometry import transform_points

TOUCHES_M = 5e-3
SPEED = 6.0
Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def ride(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    return solved_ride(cyclist(1.0), tmp_path_factory.mktemp("ride"))


@pytest.fixture(scope="module")
def descent(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    return solved_ride(snowboarder(3.0), tmp_path_factory.mktemp("descent"))


@pytest.fixture
def hall(tmp_path: Path) -> Path:
    """A red box 2 m ahead (x) and 1 m to the right (z), as glTF has it."""
    box = trimesh.creation.box((0.4, 2.0, 0.4))
    box.apply_translation((2, 1, 1))
    box.visual.vertex_colors = (190, 30, 30, 255)
    path = tmp_path / "hall.glb"
    trimesh.Scene([box]).export(path)
    return path


def pose(read: ReadGlb, node: str) -> Array:
    """(T, 4, 4) of a node, in our axes: z up."""
    turned = np.eye(4)
    turned[:3, :3] = OURS_R_SCENE
    moved: Array = turned @ read.world(read.rows[node]) @ turned.T
    return moved


def mesh(read: ReadGlb, node: str) -> Array:
    """(V, 3) of a node's mesh in its frame, in our axes."""
    primitives = read.file.meshes[read.file.nodes[read.rows[node]].mesh].primitives
    return np.concatenate([read.accessor(each.attributes.POSITION) for each in primitives]) @ OURS_R_SCENE.T


def test_a_cyclist_rides_along_a_road_with_feet_on_the_pedals(ride: Exported) -> None:
    athlete = cyclist(1.0)
    read = ReadGlb(ride.file("glb", "--environment", "road", "--travel", str(SPEED), name="road"))
    frame = pose(read, "frame")
    went = frame[:, :3, 3] - frame[0, :3, 3]
    np.testing.assert_allclose(went[:, 0], SPEED * read.seconds, atol=1e-4)
    np.testing.assert_allclose(frame[:, :3, 0] @ [1.0, 0.0, 0.0], 1.0, atol=1e-5)
    for side in ("left", "right"):
        foot, pedal = pose(read, f"foot_{side}"), pose(read, f"pedal_{side}")
        (contact,) = (each for each in athlete.equipment.attachments if each.name == f"on_pedal_{side}")
        # A bone has no rotation in the rest pose, where the person faces the viewer.
        rest_R = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        top = mesh(read, f"pedal_{side}")[:, 2].max()
        for row in range(len(frame)):
            soles = contact.on_body @ (foot[row, :3, :3] @ rest_R).T + foot[row, :3, 3]
            on_pedal = (soles - pedal[row, :3, 3]) @ pedal[row, :3, :3]
            np.testing.assert_allclose(on_pedal, contact.on_equipment, atol=TOUCHES_M)
            assert np.abs(on_pedal[:, 2] - top).max() < TOUCHES_M
    lowest = min(
        transform_points(frame[row], wheel).min(axis=0)[2] for row in (0, 15) for wheel in wheels_at_rest(read)
    )
    assert abs(lowest) < TOUCHES_M, "the tyres are on the road, whose height is 0"


def wheels_at_rest(read: ReadGlb) -> list[Array]:
    """Vertices of the wheels on the frame."""
    names = [f"frame_wheel_{number}" for number in (1, 2)]
    return [mesh(read, name) + OURS_R_SCENE @ read.file.nodes[read.rows[name]].translation for name in names]


def test_wheels_roll_as_far_as_the_bicycle_goes(ride: Exported) -> None:
    read = ReadGlb(ride.file("glb", "--environment", "road", "--travel", "40", name="fast"))
    for number in (1, 2):
        quaternions = read.keys[read.rows[f"frame_wheel_{number}"], "rotation"]
        steps = np.arccos(np.clip(np.abs(np.sum(quaternions[1:] * quaternions[:-1], axis=1)), 0.0, 1.0)) * 2.0
        assert steps.max() < 0.5 * np.pi + 1e-3, "viewers take the shorter way between two keys"
        assert steps.sum() == pytest.approx(40.0 * read.seconds[-1] / WHEEL_M, rel=1e-4)
        assert np.sign(quaternions[1, 2]) == -1.0, "about -z of glTF, which is our y: forward"


def test_a_snowboarder_rides_down_a_slope_on_it(descent: Exported) -> None:
    read = ReadGlb(descent.file("glb", "--environment", "slope:30", "--travel", "4m/s", name="slope"))
    board = pose(read, "board")
    deck = mesh(read, "board")
    normal = np.array([np.sin(np.radians(30.0)), 0.0, np.cos(np.radians(30.0))])
    above = np.array([(transform_points(each, deck) @ normal).min() for each in board])
    flying = (read.seconds > AIRBORNE_S[0]) & (read.seconds < AIRBORNE_S[1])
    assert np.abs(above[~flying]).max() < TOUCHES_M
    assert above[flying].max() == pytest.approx(0.196, abs=0.03), "it jumps for 0.4 s"
    flat = descent.solved.world_T_link["board"][:, :3, 3]
    down = np.array([np.cos(np.radians(30.0)), 0.0, -np.sin(np.radians(30.0))])
    went = (board[:, :3, 3] - board[0, :3, 3]) @ down
    ahead = descent.solved.world_T_link["board"][:, :3, 0].mean(axis=0) * [1.0, 1.0, 0.0]
    own = (flat - flat[0]) @ (ahead / np.linalg.norm(ahead))
    np.testing.assert_allclose(went, 4.0 * read.seconds + own, atol=1e-3)
    ground = mesh(read, "ground") @ normal
    assert np.abs(ground).max() < 1e-4, "the snow is where the board is"


def test_a_place_of_another_program_stays_as_it_is(ride: Exported, hall: Path) -> None:
    file = ride.file("glb", "--environment", str(hall), "--travel", "3", name="in_hall")
    scene = trimesh.load_scene(file)
    red = [190, 30, 30, 255]
    coloured = [each for each in scene.dump() if np.shape(getattr(each.visual, "vertex_colors", ())) == (8, 4)]
    (box,) = (each for each in coloured if each.visual.vertex_colors[0].tolist() == red)
    np.testing.assert_allclose(box.bounds, [[1.8, 0.0, 0.8], [2.2, 2.0, 1.2]], atol=1e-6)
    read = ReadGlb(file)
    skin = read.skin(moved=True)[0]
    assert abs(skin[:, 0].mean()) < 0.3 and abs(skin[:, 2].mean()) < 0.3, "the person starts at its origin"
    frame = pose(read, "frame")
    np.testing.assert_allclose(frame[-1, 0, 3] - frame[0, 0, 3], 3.0 * read.seconds[-1], atol=1e-4)


def test_equipment_is_where_it_was_without_a_place(ride: Exported) -> None:
    read = ReadGlb(ride.file("glb", name="alone"))
    np.testing.assert_allclose(pose(read, "frame")[:, :3, 3], ride.places("frame"), atol=1e-4)
    assert "ground" not in read.rows


@pytest.mark.parametrize(
    ("flags", "told"),
    [
        (["--travel", "3"], "--environment"),
        (["--environment", "beach"], "road, or slope:30"),
        (["--environment", "missing.glb"], "missing.glb"),
    ],
)
def test_what_cannot_be_is_named(
    ride: Exported, flags: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "wrong.glb"
    assert main(["export", str(ride.out), "--to", "glb", "-o", str(output), *flags]) == 1
    assert told in " ".join(capsys.readouterr().err.split())
    assert not output.exists()
