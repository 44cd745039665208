"""Patches of a photograph are found where they are, and where the alignment in NumPy finds them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from helpers.numpy_patches import align_in_numpy, exact_pixels
from helpers.textured_plane import Wall, exposed, texture_of
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.camera.lens_kernels import PROJECTION
from bodycam_ros.geometry import exp_se3, exp_so3, rigid
from bodycam_ros.registration.map_photographs import pyramid_levels, pyramid_size, write_pyramid
from bodycam_ros.registration.patch_kernels import align_patches

Array = NDArray[np.float64]

LENSES = {
    "equidistant": [-0.0137, 0.0037, -0.0015, 0.0004],
    "plumb_bob": [-0.05, 0.01, 4e-4, -3e-4, 0.0],
    "fov": [0.95],
}
STILL = np.zeros(6)
AS_POSED = np.zeros((0, 2))
"""Where photographs show the points: where their poses have them."""
TWIST = np.array([1.5, -2.0, 2.5, -0.8, -1.2, 0.6])
NEAR = exp_se3(np.array([0.004, -0.005, 0.006, 0.005, -0.004, 0.006]))
"""How far off a predicted pose is, in the camera's axes: some two pixels."""


def lens(model: str) -> CameraModel:
    return camera_from_info("c", 320, 240, model, LENSES[model], [130.0, 0, 161.0, 0, 131.0, 118.0, 0, 0, 1])


PHOTOGRAPH = camera_from_info("p", 320, 240, "plumb_bob", [0.02, -0.01, 0, 0], [260.0, 0, 160, 0, 261, 119, 0, 0, 1])
FISHEYE = camera_from_info("f", 500, 380, "equidistant", [0.01, -0.002, 0, 0], [255.0, 0, 248, 0, 254, 193, 0, 0, 1])


def facing(x: float, y: float, z: float, turn: Array) -> Array:
    """A pose before the wall that looks at it, turned by a little (3,) [rad]."""
    return rigid(np.diag([1.0, -1.0, -1.0]) @ exp_so3(turn), np.array([x, y, z]))


@dataclass(frozen=True)
class Scene:
    """A wall, two photographs of it, and a camera before it."""

    wall: Wall
    camera: CameraModel
    world_T_camera: Array
    world_T_reference: Array
    photographers: tuple[CameraModel, ...]
    references: Sequence[NDArray[np.uint8]]
    points_world: Array
    views: NDArray[np.int64]

    def find(self, image, near, levels=(1, 0), twist=STILL, readout_time=0.0, shown=AS_POSED, likeness=0.7):
        """Pixels (N, 2) and likeness (N,) of the compiled alignment."""
        return align_patches(
            *(self.camera.parameters, near, twist, readout_time, pyramid(image), pyramid_levels(*image.shape)),
            np.stack([camera.parameters[:PROJECTION] for camera in self.photographers]),
            np.arange(len(self.photographers), dtype=np.uint16),
            self.world_T_reference,
            padded([pyramid(reference) for reference in self.references]),
            np.stack([pyramid_levels(camera.height, camera.width) for camera in self.photographers]),
            *(self.views, shown, self.points_world, self.normals, *levels, likeness),
        )

    def find_in_numpy(self, image, near, levels=(1, 0), twist=STILL, readout_time=0.0, shown=AS_POSED, likeness=0.7):
        """The same of the alignment in NumPy."""
        references = [images_of(reference) for reference in self.references]
        return align_in_numpy(
            *(self.camera, near, twist, readout_time, images_of(image)),
            *(list(self.photographers), self.world_T_reference, references),
            *(self.views, shown, self.points_world, self.normals, *levels, likeness),
        )

    @property
    def normals(self) -> Array:
        return np.tile(self.wall.normal, (len(self.points_world), 1))

    def true_pixels(self, twist: Array = STILL, readout_time: float = 0.0) -> Array:
        return exact_pixels(self.camera, self.world_T_camera, self.points_world, twist, readout_time)


def pyramid(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    levels = pyramid_levels(*image.shape)
    into = np.zeros(pyramid_size(levels), np.uint8)
    write_pyramid(image, levels, into)
    return into


def padded(pyramids: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """As rows as long as the longest."""
    rows = np.zeros((len(pyramids), max(map(len, pyramids))), np.uint8)
    for row, pyramid in zip(rows, pyramids, strict=True):
        row[: len(pyramid)] = pyramid
    return rows


def images_of(image: NDArray[np.uint8]) -> list[NDArray[np.uint8]]:
    whole = pyramid(image)
    return [whole[start : start + h * w].reshape(h, w) for start, h, w in pyramid_levels(*image.shape).tolist()]


@pytest.fixture(scope="module")
def wall() -> Wall:
    return Wall(rigid(exp_so3(np.array([0.7, -0.4, 0.3])), np.array([0.5, -0.2, 1.0])), texture_of(3))


Photographs = tuple[Array, tuple[CameraModel, ...], Sequence[NDArray[np.uint8]]]


@pytest.fixture(scope="module")
def photographs(wall: Wall) -> Photographs:
    """By a camera, and by another of another size and kind."""
    first = wall.world_T_wall @ facing(0.2, 0.1, 2.6, np.array([0.05, 0.05, 0.4]))
    second = wall.world_T_wall @ facing(-0.4, -0.3, 2.0, np.array([-0.1, 0.15, -0.5]))
    pictures = [exposed(wall.light(PHOTOGRAPH, first)), exposed(wall.light(FISHEYE, second))]
    return np.stack([first, second]), (PHOTOGRAPH, FISHEYE), pictures


def scene_of(wall: Wall, photographs: Photographs, camera: CameraModel) -> Scene:
    places = np.stack(np.meshgrid(np.linspace(-0.6, 0.7, 13), np.linspace(-0.5, 0.4, 11)), axis=-1).reshape(-1, 2)
    pose = wall.world_T_wall @ facing(0.1, -0.1, 1.5, np.array([0.15, -0.1, 0.9]))
    views = np.arange(len(places)) % 2
    world_T_reference, photographers, references = photographs
    return Scene(wall, camera, pose, world_T_reference, photographers, references, wall.points(places), views)


@pytest.fixture(scope="module", params=LENSES)
def scene(request: pytest.FixtureRequest, wall: Wall, photographs) -> Scene:
    return scene_of(wall, photographs, lens(request.param))


@pytest.fixture(scope="module")
def fisheye(wall: Wall, photographs) -> Scene:
    return scene_of(wall, photographs, lens("equidistant"))


@pytest.fixture(scope="module")
def light(fisheye: Scene) -> Array:
    return fisheye.wall.light(fisheye.camera, fisheye.world_T_camera)


@pytest.fixture(scope="module")
def image(scene: Scene) -> NDArray[np.uint8]:
    """Darker and flatter than the photographs."""
    return exposed(scene.wall.light(scene.camera, scene.world_T_camera), gain=0.7, bias=12.0)


def errors(pixels: Array, truth: Array, likeness: Array) -> Array:
    found = np.isfinite(likeness)
    return np.asarray(np.linalg.norm(pixels - truth, axis=1)[found])


@pytest.mark.parametrize("levels", [(1, 0), (3, 1)], ids=str)
def test_finds_what_numpy_finds(scene: Scene, image: NDArray[np.uint8], levels: tuple[int, int]) -> None:
    near = scene.world_T_camera @ NEAR
    for options in (
        {},
        {"twist": TWIST, "readout_time": 0.02},
        {"shown": scene.true_pixels(), "likeness": 0.2},  # in the wrong places of the photographs
    ):
        pixels, likeness = scene.find(image, near, levels, **options)
        numpy_pixels, numpy_likeness = scene.find_in_numpy(image, near, levels, **options)
        np.testing.assert_array_equal(np.isfinite(likeness), np.isfinite(numpy_likeness))
        np.testing.assert_allclose(pixels, numpy_pixels, atol=2e-3)
        np.testing.assert_allclose(likeness, numpy_likeness, atol=1e-4)
        assert np.isfinite(likeness).sum() >= (20 if "shown" not in options else 0)


def test_patches_are_found_to_a_twentieth_of_a_pixel(scene: Scene, image: NDArray[np.uint8]) -> None:
    pixels, likeness = scene.find(image, scene.world_T_camera @ NEAR)
    off = errors(pixels, scene.true_pixels(), likeness)
    predicted = exact_pixels(scene.camera, scene.world_T_camera @ NEAR, scene.points_world, STILL, 0.0)
    assert np.median(errors(predicted, scene.true_pixels(), likeness)) > 0.8
    assert len(off) > 0.95 * len(likeness)
    assert np.median(off) < 0.05 and np.percentile(off, 90) < 0.1


@pytest.mark.parametrize("exposure", [{"gain": 0.3}, {"gamma": 1.6, "bias": 20.0}], ids=str)
def test_light_and_exposure_make_no_difference(fisheye: Scene, light: Array, exposure: dict[str, float]) -> None:
    image = exposed(light, **exposure)
    pixels, likeness = fisheye.find(image, fisheye.world_T_camera @ NEAR)
    off = errors(pixels, fisheye.true_pixels(), likeness)
    assert len(off) > 0.9 * len(likeness)
    assert np.median(off) < 0.08


@pytest.mark.parametrize("readout_time", [0.025, -0.025])
def test_rows_that_are_read_out_one_by_one(fisheye: Scene, readout_time: float) -> None:
    image = exposed(fisheye.wall.light(fisheye.camera, fisheye.world_T_camera, TWIST, readout_time))
    truth = fisheye.true_pixels(TWIST, readout_time)
    assert np.median(np.linalg.norm(truth - fisheye.true_pixels(), axis=1)) > 0.6
    pixels, likeness = fisheye.find(image, fisheye.world_T_camera, twist=TWIST, readout_time=readout_time)
    off = errors(pixels, truth, likeness)
    assert len(off) > 0.9 * len(truth)
    assert np.median(off) < 0.08
