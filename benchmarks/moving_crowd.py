"""Paste a moving crowd into a bag's images: python -m benchmarks.moving_crowd BAG SOLVED OUT --cameras head shin_left.

People of ellipsoids walk around the wearer, each with a texture of its own that moves with it, and are seen through
each camera's lens from where the undisturbed recording was solved to be (SOLVED, what ``bodycam replay`` wrote of
BAG). So they are coherent in time, between cameras, and in a fisheye picture. In a ``mill`` everybody goes a way of his
own; a ``stream`` goes past the wearer as one, and is the worse lie: all that moves in it moves alike, as a room would.
With ``--pictures`` people wear photographs, of the place itself if it shall be hard: then what they wear is in the map.

People hide the wearer's own limbs, which are nearer in truth; they have no shadow, and are not blurred by motion.
"""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import exp_so3, inverse
from bodycam_ros.kernels import as_rows
from bodycam_ros.messages.factory import stamp_ns
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.results.body_motion import interpolated
from bodycam_ros.results.solved_recording import read_solved

IMAGES = "/image_raw/compressed"
Array = NDArray[np.float64]

_PARTS = np.array(
    [
        # x, y, z of the middle and half axes [m], in axes x forward, y left, z up from between the feet
        [0.0, 0.10, 0.46, 0.09, 0.085, 0.46],
        [0.0, -0.10, 0.46, 0.09, 0.085, 0.46],
        [0.0, 0.0, 1.15, 0.15, 0.22, 0.36],
        [0.0, 0.28, 1.12, 0.06, 0.06, 0.34],
        [0.0, -0.28, 1.12, 0.06, 0.06, 0.34],
        [0.0, 0.0, 1.63, 0.11, 0.09, 0.14],
    ]
)
_MIDDLE_M, _REACH_M = 0.9, 1.0
"""Height of a ball's middle, and its radius, that holds a person."""

_TEXTURE = 256
_SMOOTH_S = 1.0
"""The wearer goes smoothly, however the cameras swing."""

_FILES = np.array([1.0, -1.0, 1.6, -1.6])
"""Where files of a stream go, to the left of the wearer, times the distance of the nearest."""

_SPACING_M = 0.75
"""Between the people of a file."""

_JPEG_QUALITY = 95


@dataclass(frozen=True)
class Crowd:
    """People over time.

    Attributes:
        stamps_ns: (T) [ns].
        world_T_person: (T, P, 4, 4), between the feet, z up.
        size: of people, times 1.77 m.
        textures: (P, 256, 256) grey, around a part and along it.
    """

    stamps_ns: NDArray[np.int64]
    world_T_person: Array
    size: float
    textures: NDArray[np.uint8]

    def poses(self, at_ns: int) -> Array:
        """Where everybody is (P, 4, 4) at a time."""
        at = np.array([at_ns])
        return np.concatenate([interpolated(self.stamps_ns, way, at) for way in self.world_T_person.swapaxes(0, 1)])


def mill(stamps_ns: NDArray[np.int64], wearer: Array, people: int, distance: float, rng: np.random.Generator) -> Array:
    """Poses (T, P, 4, 4) of people who circle a wearer at (T, 2) [m], each at a pace of its own, to either side."""
    seconds = 1e-9 * (stamps_ns - stamps_ns[0])[:, None]
    begin = 2 * np.pi * (np.arange(people) + rng.uniform(-0.3, 0.3, people)) / people
    speed = rng.uniform(0.25, 0.8, people) * rng.choice([-1.0, 1.0], people)
    sway = 0.15 * np.sin(seconds * rng.uniform(0.5, 2.0, people) + begin)
    radius = distance * rng.uniform(1.0, 1.6, people) + sway
    angle = begin + speed * seconds
    places = wearer[:, None] + radius[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return _upright(places, angle + np.pi / 2)


def stream(
    stamps_ns: NDArray[np.int64], wearer: Array, people: int, distance: float, rng: np.random.Generator
) -> Array:
    """Poses (T, P, 4, 4) of people in two files to either side of a wearer at (T, 2) [m], who all go past as one."""
    seconds = 1e-9 * (stamps_ns - stamps_ns[0])
    along = (wearer[-1] - wearer[0]) / max(float(np.linalg.norm(wearer[-1] - wearer[0])), 1e-9)
    aside = np.array([-along[1], along[0]])
    files = len(_FILES)
    rows = -(-people // files)
    slot, file = np.arange(people) // files, np.arange(people) % files
    offset = _FILES[file] * distance
    # Who falls behind by half of the stream's length comes in again in front, too far away to be seen well.
    gone = 1.2 * seconds[:, None] + _SPACING_M * (slot + 0.5 * (file // 2) + rng.uniform(-0.1, 0.1, people))
    length = _SPACING_M * rows
    ahead = (gone - (wearer @ along)[:, None] + 0.5 * length) % length - 0.5 * length
    middle = (wearer @ aside)[:1, None]
    places = ((wearer @ along)[:, None] + ahead)[..., None] * along + (middle + offset)[..., None] * aside
    return _upright(places, np.full(places.shape[:2], np.arctan2(along[1], along[0])))


MOTIONS = {"mill": mill, "stream": stream}


def _upright(places: Array, heading: Array) -> Array:
    poses = np.tile(np.eye(4), (*places.shape[:2], 1, 1))
    poses[..., :3, :3] = exp_so3(heading[..., None] * np.array([0.0, 0.0, 1.0]))
    poses[..., :2, 3] = places
    return poses


def clothes(people: int, rng: np.random.Generator, pictures: Path | None) -> NDArray[np.uint8]:
    """Textures (P, 256, 256): blotches of all sizes, or pieces of photographs in a folder."""
    files = [] if pictures is None else sorted(p for p in pictures.iterdir() if p.suffix in (".jpg", ".png"))
    worn = []
    for _ in range(people):
        if files:
            photograph = cv2.imread(str(files[rng.integers(len(files))]), cv2.IMREAD_GRAYSCALE)
            side = min(photograph.shape) // 2
            row, column = rng.integers(0, photograph.shape[0] - side), rng.integers(0, photograph.shape[1] - side)
            worn.append(cv2.resize(photograph[row : row + side, column : column + side], (_TEXTURE, _TEXTURE)))
            continue
        cloth = np.zeros((_TEXTURE, _TEXTURE))
        for size in (4, 12, 32, 64):
            blotches = cv2.resize(rng.normal(size=(size, size)), (_TEXTURE, _TEXTURE), interpolation=cv2.INTER_CUBIC)
            cloth += blotches
        worn.append(np.clip(rng.uniform(70, 150) + 32.0 * cloth, 5, 250).astype(np.uint8))
    return np.asarray(worn, np.uint8)


@njit()
def _look(
    rays: Array,
    origin: Array,
    person_T_world: Array,
    parts: Array,
    size: float,
    textures: NDArray[np.uint8],
    shade: NDArray[np.uint8],
    seen: NDArray[np.uint8],
) -> None:
    """Fill what rays (N, 3) from a point of the world meet first: shade (N) and whether it is a person (N)."""
    people, cells = len(person_T_world), textures.shape[1]
    middle, reach = _MIDDLE_M * size, _REACH_M * size
    starts = np.empty((people, 3))
    for p in range(people):
        for k in range(3):
            starts[p, k] = person_T_world[p, k, 3]
            for m in range(3):
                starts[p, k] += person_T_world[p, k, m] * origin[m]
    for n in range(len(rays)):
        nearest = np.inf
        for p in range(people):
            x = starts[p, 0]
            y = starts[p, 1]
            z = starts[p, 2] - middle
            dx = dy = dz = 0.0
            for m in range(3):
                dx += person_T_world[p, 0, m] * rays[n, m]
                dy += person_T_world[p, 1, m] * rays[n, m]
                dz += person_T_world[p, 2, m] * rays[n, m]
            towards = -(x * dx + y * dy + z * dz)
            aside = x * x + y * y + z * z - towards * towards
            if not aside < reach * reach or towards + reach < 0.0:  # a ray of NaN meets nobody
                continue
            for part in range(len(parts)):
                a, b, c = parts[part, 3], parts[part, 4], parts[part, 5]
                ox, oy = (starts[p, 0] - parts[part, 0]) / a, (starts[p, 1] - parts[part, 1]) / b
                oz = (starts[p, 2] - parts[part, 2]) / c
                rx, ry, rz = dx / a, dy / b, dz / c
                square, half = rx * rx + ry * ry + rz * rz, ox * rx + oy * ry + oz * rz
                inside = half * half - square * (ox * ox + oy * oy + oz * oz - 1.0)
                if inside <= 0.0:
                    continue
                far = (-half - np.sqrt(inside)) / square
                if 0.05 < far < nearest:
                    nearest = far
                    hx, hy, hz = ox + far * rx, oy + far * ry, oz + far * rz
                    across = (np.arctan2(hy, hx) / (2.0 * np.pi) + 0.5 + 0.13 * part) % 1.0 * (cells - 1)
                    up = (0.5 * min(max(hz, -1.0), 1.0) + 0.5) * (cells - 1)
                    column, row = int(across), int(up)
                    u, v = across - column, up - row
                    right, below = min(column + 1, cells - 1), min(row + 1, cells - 1)
                    top = (1 - u) * textures[p, row, column] + u * textures[p, row, right]
                    bottom = (1 - u) * textures[p, below, column] + u * textures[p, below, right]
                    shade[n] = int((1 - v) * top + v * bottom)
                    seen[n] = 255


class Sight:
    """What one camera sees of a crowd.

    Args:
        camera: its lens.
        stamps_ns: (T) at which its pose is known [ns].
        world_T_camera: (T, 4, 4).
    """

    def __init__(self, camera: CameraModel, stamps_ns: NDArray[np.int64], world_T_camera: Array) -> None:
        self._shape = camera.height, camera.width
        rows, columns = np.mgrid[: camera.height, : camera.width]
        self._bearings, _ = camera.unproject(np.column_stack([columns.ravel(), rows.ravel()]).astype(np.float64))
        self._stamps_ns, self._world_T_camera = stamps_ns, world_T_camera
        self.covered: list[float] = []

    def paste(self, image: NDArray[np.uint8], crowd: Crowd, at_ns: int) -> NDArray[np.uint8]:
        """The image (H, W) or (H, W, C) with the crowd in it."""
        known_ns = int(np.clip(at_ns, self._stamps_ns[0], self._stamps_ns[-1]))
        world_T_camera = interpolated(self._stamps_ns, self._world_T_camera, np.array([known_ns]))[0]
        shade, seen = np.zeros(image.shape[:2], np.uint8), np.zeros(image.shape[:2], np.uint8)
        rays = as_rows(self._bearings @ world_T_camera[:3, :3].T)
        people = as_rows(inverse(crowd.poses(known_ns)))
        _look(
            rays,
            as_rows(world_T_camera[:3, 3]),
            people,
            crowd.size * _PARTS,
            crowd.size,
            crowd.textures,
            shade.ravel(),
            seen.ravel(),
        )
        self.covered.append(float((seen > 0).mean() / np.isfinite(self._bearings[:, 0]).mean()))
        # As sharp as a lens makes an edge.
        cover = cv2.GaussianBlur(seen, (3, 3), 0)[..., None] / 255.0
        pasted = (1.0 - cover) * np.atleast_3d(image) + cover * np.where(seen > 0, shade, 128)[..., None]
        return np.asarray(np.rint(pasted).reshape(image.shape), np.uint8)


def make_crowd(
    solved: Path, motion: str, people: int, distance: float, size: float, seed: int, pictures: Path | None
) -> Crowd:
    """A crowd around the wearer of a solved bag: where the mean of the cameras goes, smoothed."""
    recording, rng = read_solved(solved), np.random.default_rng(seed)
    places = np.mean([poses[:, :2, 3] for _, poses in recording.solved_cameras()], axis=0)
    half = round(0.5e9 * _SMOOTH_S / recording.frame_ns)
    # Beyond its ends the way goes on as it began and as it ended.
    before, after = 2 * places[0] - places[half:0:-1], 2 * places[-1] - places[-2 : -half - 2 : -1]
    longer = np.concatenate([before, places, after])
    wearer = np.stack([np.convolve(axis, np.ones(2 * half + 1) / (2 * half + 1), "valid") for axis in longer.T], axis=1)
    poses = MOTIONS[motion](recording.stamps_ns, wearer, people, distance, rng)
    return Crowd(recording.stamps_ns, poses, size, clothes(people, rng, pictures))


def paste_crowd(source: Path, solved: Path, target: Path, crowd: Crowd, cameras: list[str]) -> Mapping[str, float]:
    """Write the bag anew with the crowd in the images of some cameras; the share that it takes of each one's."""
    motion = read_solved(solved)
    with open_recording(source) as recording:
        sights = {
            f"/{record.camera}{IMAGES}": Sight(recording.camera_model(record.camera), motion.stamps_ns, poses)
            for record, poses in motion.solved_cameras()
            if record.camera in cameras
        }
    if missing := set(cameras) - {topic.removesuffix(IMAGES).strip("/") for topic in sights}:
        raise SystemExit(f"{solved}: has no pose of {', '.join(sorted(missing))}")
    with BagFile(source) as bag, write_recording(target) as writer:
        for topic, recorded_ns, message in bag.messages(bag.topics):
            if topic in sights:
                image = np.asarray(cv2.imdecode(np.asarray(message.data), cv2.IMREAD_UNCHANGED), np.uint8)
                image = sights[topic].paste(image, crowd, stamp_ns(message.header.stamp))
                message.data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].ravel()
            writer.write(topic, recorded_ns, message)
    return {topic.removesuffix(IMAGES).strip("/"): float(np.mean(sight.covered)) for topic, sight in sights.items()}


def main() -> None:
    """Parse the command line and paste."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bag", type=Path)
    parser.add_argument("solved", type=Path, help="what 'bodycam replay' wrote of the bag")
    parser.add_argument("out", type=Path, help="bag folder to be")
    parser.add_argument("--cameras", nargs="+", required=True, help="whose images the crowd walks through")
    parser.add_argument("--motion", choices=sorted(MOTIONS), default="mill")
    parser.add_argument("--people", type=int, default=24)
    parser.add_argument("--distance", type=float, default=1.0, help="of the nearest from the wearer [m]")
    parser.add_argument("--size", type=float, default=1.0, help="of people, times 1.77 m")
    parser.add_argument("--pictures", type=Path, help="folder of photographs that people wear")
    parser.add_argument("--seed", type=int, default=0)
    of = parser.parse_args()
    crowd = make_crowd(of.solved, of.motion, of.people, of.distance, of.size, of.seed, of.pictures)
    for camera, share in paste_crowd(of.bag, of.solved, of.out, crowd, of.cameras).items():
        print(f"{camera}: {share:.0%} of the picture")


if __name__ == "__main__":
    main()
