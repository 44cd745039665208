"""Places of other programs' files."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from helpers.filmed_ball import SIZE, ball

from bodycam_ros.environment.environment import Environment
from bodycam_ros.environment.scenery import read_scenery
from bodycam_ros.errors import ViewError
from bodycam_ros.film.picture import PictureMaker
from bodycam_ros.film.place import Place
from bodycam_ros.film.views import looking_at, outside_lens


@pytest.fixture
def hall(tmp_path: Path) -> Path:
    """A green floor below y = 0, and a red pillar 2 m ahead (x) and 1 m to the right (z), as glTF has them."""
    scene = trimesh.Scene()
    for size, centre, colour in (
        ((20.0, 0.02, 20.0), (0, -0.01, 0), (40, 160, 60)),
        ((0.4, 2.0, 0.4), (2, 1, 1), (190, 30, 30)),
    ):
        box = trimesh.creation.box(size)
        box.apply_translation(centre)
        box.visual.vertex_colors = (*colour, 255)
        scene.add_geometry(box)
    path = tmp_path / "hall.glb"
    scene.export(path)
    return path


def test_y_of_the_file_is_up_and_its_z_to_the_right(hall: Path) -> None:
    scenery = read_scenery(hall)
    red = scenery.triangles[scenery.colours[:, 0] > scenery.colours[:, 1]]
    np.testing.assert_allclose(scenery.vertices[red].reshape(-1, 3).min(axis=0), [1.8, -1.2, 0.0], atol=1e-6)
    np.testing.assert_allclose(scenery.vertices[red].reshape(-1, 3).max(axis=0), [2.2, -0.8, 2.0], atol=1e-6)


def test_a_pillar_hides_who_is_behind_it_and_the_floor_has_their_shadow(hall: Path) -> None:
    place = Place(0.0, np.zeros((0, 3)), np.zeros((0, 3), np.uint8), None, scenery=read_scenery(hall))
    maker = PictureMaker(outside_lens(*SIZE), (0, 0, *SIZE), place)
    world_T_camera = looking_at(np.array([0.0, -1.0, 1.0]), np.array([2.0, -1.0, 1.0]))
    behind = maker.draw(ball([3.0, -1.0, 1.0], 0.15), world_T_camera, None)
    away = maker.draw(ball([3.0, 30.0, 1.0], 0.15), world_T_camera, None)
    middle = behind[SIZE[1] // 2, SIZE[0] // 2].astype(int)
    assert middle[2] > middle[1] + 40, "the pillar is red"
    np.testing.assert_array_equal(behind[SIZE[1] // 2], away[SIZE[1] // 2])
    from_above = looking_at(np.array([0.0, 1.5, 4.0]), np.array([3.0, 1.5, 0.0]))
    lit = maker.draw(ball([3.0, 30.0, 1.0], 0.3), from_above, None).astype(int)
    shaded = maker.draw(ball([3.2, 2.0, 0.6], 0.3), from_above, None).astype(int)
    green = (lit[..., 1] > lit[..., 0] + 30) & (shaded[..., 1] > shaded[..., 0] + 15)
    assert (green & (shaded[..., 1] < 0.8 * lit[..., 1])).sum() > 100


def test_it_is_an_environment_by_its_name(hall: Path) -> None:
    environment = Environment.parse(str(hall), 2.0)
    assert environment.scenery is not None and environment.speed == 2.0


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "broken.glb"
    path.write_bytes(b"glTF\x02\x00\x00\x00rest")
    with pytest.raises(ViewError, match=r"broken\.glb"):
        Environment.parse(str(path), 0.0)
    with pytest.raises(ViewError, match=r"missing\.glb"):
        Environment.parse(str(tmp_path / "missing.glb"), 0.0)
