"""A box over real photographs, followed by its regions and by silhouette ICP: python test/tools/track_box.py.

One static VGA camera, a box of 24 x 16 x 10 cm, painted by OpenCV. As the literature counts, a frame is a success
within 5 cm and 5 degrees, and after a failure both start again at the truth. Where fewer frames are shown, motion from
one to the next is larger. Both start from where the box was in the frame before, and know nothing of how it moves.
"""

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import trimesh
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.geometry import exp_so3, log_so3, rigid, transform_points
from bodycam_ros.kernels.kernel import compile_all
from bodycam_ros.outside.articulated_step import ExpectedBody
from bodycam_ros.outside.body_surface import BodySurface
from bodycam_ros.outside.region_settings import RegionSettings
from bodycam_ros.outside.region_tracker import RegionTracker
from bodycam_ros.outside.station import Station
from bodycam_ros.outside.surface import Surface

sys.path.insert(0, str(Path(__file__).parent.parent))
from outside.painted_scene import Painted, grained, paint  # noqa: E402
from tools.silhouette_icp import SilhouetteIcp  # noqa: E402

Array = NDArray[np.float64]
Image = NDArray[np.uint8]
Look = Callable[[Image, Array], Array]

NEAR_M, NEAR_DEG = 0.05, 5.0
STEPS = (1, 2, 4)
PHOTOGRAPHS_OF_SAMPLE = Path(__file__).parents[2] / "bags" / "reference"
PHOTOGRAPHS = ("ref_0098.jpg", "ref_0103.jpg", "ref_0107.jpg")
COLOURS = {"blue box": (150, 70, 40), "box like the floor": (95, 130, 170)}
LIGHT = np.array([0.3, -0.8, -0.5]) / np.linalg.norm([0.3, -0.8, -0.5])
EXPECTED_SIGMAS = np.repeat([0.3, 0.1], 3)  # of a box that may have moved anyhow

CAMERA = camera_from_info("box", 640, 480, "plumb_bob", [-0.03, 0.01, 0, 0, 0], [470, 0, 319, 0, 470, 241, 0, 0, 1])


@dataclass(frozen=True)
class Outcome:
    """Of one tracker on one sequence: whether each frame was a success, its errors [m], [deg], and the time [s]."""

    success: NDArray[np.bool_]
    off_m: Array
    off_deg: Array
    seconds: float

    @property
    def rate(self) -> float:
        return float(self.success.mean())


def box_surface() -> Surface:
    """Its sides in small faces, which the painter shades one by one."""
    mesh = trimesh.creation.box(extents=(0.24, 0.16, 0.10)).subdivide().subdivide().subdivide()
    return Surface("box", np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int32))


def smooth_motion(frames: int, seed: int) -> Array:
    """(T, 4, 4) camera_T_box: waves of random phase in all six directions, in sight all the while."""
    random = np.random.default_rng(seed)
    turns = 2.0 * np.pi * np.arange(frames)[:, None, None] / random.uniform(70.0, 200.0, (6, 3))
    waves = np.sin(turns + random.uniform(0.0, 2.0 * np.pi, (6, 3))).sum(axis=2) / np.sqrt(3.0)
    rotations = exp_so3(1.1 * waves[:, :3])
    return rigid(rotations, np.array([0.0, 0.0, 0.95]) + waves[:, 3:] * [0.15, 0.10, 0.15])


def painted_frames(surface: Surface, colour: tuple[int, int, int], photograph: Image, motion: Array) -> Iterator[Image]:
    """The box over a photograph, lit from one side, printed in patches, with the grain of a sensor."""
    random = np.random.default_rng(1)
    print_on_it = np.where(random.random((len(surface.faces), 1)) < 0.2, 0.55, 1.0)
    for pose in motion:
        light = 0.55 + 0.45 * np.maximum(surface.face_normals @ pose[:3, :3].T @ LIGHT, 0.0)[:, None]
        box = Painted(transform_points(pose, surface.vertices), surface.faces, print_on_it * light * np.array(colour))
        yield grained(paint(CAMERA, np.eye(4), photograph, [box]), random)


def read_photograph(path: Path, camera: CameraModel) -> Image:
    picture = cv2.imread(str(path))
    assert picture is not None
    return np.asarray(cv2.resize(picture, (camera.width, camera.height), interpolation=cv2.INTER_AREA), np.uint8)


class BoxRegions:
    """The region tracker with a body of one segment."""

    def __init__(self, surface: Surface, settings: RegionSettings) -> None:
        body = BodyModel("box", "box", ("box",), (), {})
        stations = {"box": Station("box", np.eye(4), CAMERA)}
        self._tracker = RegionTracker(body, BodySurface.of(body, {"box": surface}), stations, settings)

    def look(self, image: Image, before: Array) -> Array:
        expected = ExpectedBody(before[None], EXPECTED_SIGMAS, 1.0)
        return self._tracker.look({"box": image}, expected).world_T_segment[0]

    def start(self, image: Image, pose: Array) -> None:
        self._tracker.learn({"box": image}, pose[None])


def follow(frames: list[Image], motion: Array, look: Look, start: Callable[[Image, Array], None]) -> Outcome:
    """From the truth in the first frame through the others; from the truth again after a failure."""
    pose, seconds, errors = motion[0], 0.0, []
    start(frames[0], pose)
    for image, truth in zip(frames[1:], motion[1:], strict=True):
        began = time.perf_counter()
        pose = look(image, pose)
        seconds += time.perf_counter() - began
        turned = np.degrees(np.linalg.norm(log_so3(pose[:3, :3].T @ truth[:3, :3])))
        errors.append((np.linalg.norm(pose[:3, 3] - truth[:3, 3]), turned))
        if not (errors[-1][0] < NEAR_M and errors[-1][1] < NEAR_DEG):
            pose = truth
            start(image, pose)
    off_m, off_deg = np.array(errors).T
    return Outcome((off_m < NEAR_M) & (off_deg < NEAR_DEG), off_m, off_deg, seconds / len(errors))


def compare(frames: list[Image], motion: Array, settings: RegionSettings) -> dict[str, Outcome]:
    """Both trackers on the same frames."""
    surface = box_surface()
    regions, icp = BoxRegions(surface, settings), SilhouetteIcp(CAMERA, surface)
    return {
        "regions": follow(frames, motion, regions.look, regions.start),
        "silhouette ICP": follow(frames, motion, icp.look, lambda image, pose: None),
    }


def joined(outcomes: list[Outcome]) -> Outcome:
    """Of several sequences as if they were one."""
    parts = [np.concatenate([getattr(one, name) for one in outcomes]) for name in ("success", "off_m", "off_deg")]
    return Outcome(*parts, float(np.mean([one.seconds for one in outcomes])))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("photographs", nargs="?", type=Path, default=PHOTOGRAPHS_OF_SAMPLE, help="folder")
    parser.add_argument("--frames", type=int, default=200)
    chosen = parser.parse_args()
    cv2.setNumThreads(1)
    compile_all()
    shown = f"{len(PHOTOGRAPHS)} x {chosen.frames} frames"
    table = Table(title=f"Success within {100 * NEAR_M:.0f} cm and {NEAR_DEG:.0f} deg; {shown}")
    for column in ("", "shown", "moves", "tracker", "success", "median error", "ms"):
        table.add_column(column, no_wrap=True)
    for name, colour in COLOURS.items():
        sequences = []
        for seed, photograph in enumerate(PHOTOGRAPHS):
            motion = smooth_motion(chosen.frames, seed)
            background = read_photograph(chosen.photographs / photograph, CAMERA)
            sequences.append((list(painted_frames(box_surface(), colour, background, motion)), motion))
        for step in STEPS:
            runs = [compare(frames[::step], motion[::step], RegionSettings()) for frames, motion in sequences]
            far_m, far_deg = np.concatenate([_moves(motion[::step]) for _, motion in sequences]).mean(axis=0)
            for tracker in runs[0]:
                one = joined([run[tracker] for run in runs])
                moves = f"{100 * far_m:.1f} cm {far_deg:.0f} deg"
                off = f"{1e3 * np.median(one.off_m):.1f} mm {np.median(one.off_deg):.2f} deg"
                rate, time_ms = f"{100 * one.rate:.1f} %", f"{1e3 * one.seconds:.1f}"
                table.add_row(name, f"1 of {step}", moves, tracker, rate, off, time_ms)
    Console(width=120).print(table)


def _moves(motion: Array) -> Array:
    """(T - 1, 2) from frame to frame [m], [deg]."""
    turns = np.degrees(np.linalg.norm(log_so3(np.swapaxes(motion[:-1, :3, :3], 1, 2) @ motion[1:, :3, :3]), axis=1))
    return np.column_stack([np.linalg.norm(np.diff(motion[:, :3, 3], axis=0), axis=1), turns])


if __name__ == "__main__":
    main()
