"""Real images registered in a map of others, beside COLMAP: python -m benchmarks.euroc_against_colmap EUROC.

EUROC holds ``cam0``, ``cam1``, ``camera_*.yaml``, ``world_T_cam0.tum`` and a README with the extrinsics, as the EuRoC
data set has them. Every second image of cam0 makes the map; the others, and all of cam1, are registered one by one, by
us in that map, by COLMAP in the model of that map: its own features, their matches with every photograph, a pose for
each image while the model stands still. Both sides have one thread.
"""

import argparse
import re
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from benchmarks.stage_timing import timed_method
from bodycam_ros.camera import CameraModel, camera_from_yaml
from bodycam_ros.camera.colmap_model import colmap_camera, pycolmap
from bodycam_ros.cli.main import main as bodycam
from bodycam_ros.geometry import inverse, umeyama
from bodycam_ros.registration.image_registration import ImageRegistration
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.keypoints import KeypointDetector

Poses = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Side:
    """What one of the two registered, world_T_camera (4, 4) by image, and the processor's time for it [s]."""

    poses: Poses
    features_s: float
    registration_s: float

    @property
    def seconds(self) -> float:
        """From images to poses."""
        return self.features_s + self.registration_s


@dataclass(frozen=True)
class Comparison:
    """Both sides, on the same images; errors are of positions, after the photographs are aligned to the truth [m]."""

    asked: int
    ours: Side
    colmap: Side
    photograph_errors: NDArray[np.float64]
    our_errors: NDArray[np.float64]
    colmap_errors: NDArray[np.float64]


def compare(euroc: Path, scratch: Path) -> Comparison:
    """Make the map, register the rest on both sides, and hold it to the truth."""
    photographs = sorted((euroc / "cam0").glob("*.jpg"))[::2]
    asked = {f"cam0/{p.name}": p for p in sorted((euroc / "cam0").glob("*.jpg"))[1::2]}
    asked |= {f"cam1/{p.name}": p for p in sorted((euroc / "cam1").glob("*.jpg"))}
    cameras = {name: camera_from_yaml(euroc / f"camera_{name}.yaml") for name in ("cam0", "cam1")}
    reference = scratch / "reference"
    reference.mkdir()
    for path in photographs:
        (reference / path.name).symlink_to(path.resolve())
    (reference / "camera.yaml").symlink_to((euroc / "camera_cam0.yaml").resolve())
    if bodycam(["map", str(reference), "-o", str(scratch / "map")]) != 0:
        raise SystemExit("there is no map")
    reference_map = ReferenceMap.load(scratch / "map")
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1):
            ours = register(reference_map, cameras, asked)
            theirs = register_by_colmap(reference_map, euroc, cameras, asked, scratch)
    finally:
        cv2.setNumThreads(threads)

    truth = true_poses(euroc)
    photographed = {
        f"cam0/{name}": pose
        for name, pose in zip(reference_map.image_names, reference_map.world_T_camera, strict=True)
        if f"cam0/{name}" in truth
    }
    seen = np.array([pose[:3, 3] for pose in photographed.values()])
    scale, R, t = umeyama(seen, np.array([truth[name][:3, 3] for name in photographed]), with_scale=True)

    def errors(poses: Poses) -> NDArray[np.float64]:
        known = [name for name in poses if name in truth]
        places = np.array([poses[name][:3, 3] for name in known]).reshape(-1, 3)
        off = scale * places @ R.T + t - np.array([truth[name][:3, 3] for name in known]).reshape(-1, 3)
        return np.asarray(np.linalg.norm(off, axis=1))

    return Comparison(len(asked), ours, theirs, errors(photographed), errors(ours.poses), errors(theirs.poses))


def register(reference_map: ReferenceMap, cameras: dict[str, CameraModel], asked: dict[str, Path]) -> Side:
    """Register images one by one; what a process does once, such as loading kernels, is done before."""
    one = {name: ImageRegistration(camera, reference_map) for name, camera in cameras.items()}
    first, path = next(iter(asked.items()))
    one[first[:4]].register(_grey(path))
    poses: Poses = {}
    start = time.process_time()
    with timed_method(KeypointDetector, "detect") as detecting:
        for name, path in asked.items():
            pose = one[name[:4]].register(_grey(path)).world_T_camera
            if pose is not None:
                poses[name] = pose
    features_s = sum(detecting)
    return Side(poses, features_s, time.process_time() - start - features_s)


def register_by_colmap(
    reference_map: ReferenceMap, euroc: Path, cameras: dict[str, CameraModel], asked: dict[str, Path], scratch: Path
) -> Side:
    """The same by COLMAP; that the photographs have its own features and points, at our poses, is not timed."""
    database = scratch / "colmap.db"
    photographs = [f"cam0/{name}" for name in reference_map.image_names]
    _extract(database, euroc, photographs, cameras["cam0"])
    pairs = [(a, b) for i, a in enumerate(photographs) for b in photographs[:i]]
    _match(database, pairs, scratch)
    model = _triangulated(database, dict(zip(photographs, reference_map.world_T_camera, strict=True)), scratch)

    start = time.process_time()
    for camera in ("cam0", "cam1"):
        _extract(database, euroc, [name for name in asked if name.startswith(camera)], cameras[camera])
    features_s = time.process_time() - start
    start = time.process_time()
    _match(database, [(name, photograph) for name in asked for photograph in photographs], scratch)
    poses = _registered(database, model, set(asked))
    return Side(poses, features_s, time.process_time() - start)


def _extract(database: Path, images: Path, names: list[str], camera: CameraModel) -> None:
    colmap = colmap_camera(camera)
    pycolmap.extract_features(
        database,
        images,
        image_names=names,
        camera_mode=pycolmap.CameraMode.SINGLE,
        reader_options=pycolmap.ImageReaderOptions(
            camera_model=colmap.model.name, camera_params=", ".join(map(str, colmap.params))
        ),
        extraction_options=pycolmap.FeatureExtractionOptions(num_threads=1, use_gpu=False),
    )


def _match(database: Path, pairs: list[tuple[str, str]], scratch: Path) -> None:
    listed = scratch / "pairs.txt"
    listed.write_text("".join(f"{first} {second}\n" for first, second in pairs))
    pycolmap.match_image_pairs(
        database,
        matching_options=pycolmap.FeatureMatchingOptions(num_threads=1, use_gpu=False),
        pairing_options=pycolmap.ImportedPairingOptions(match_list_path=listed),
    )


def _options() -> pycolmap.IncrementalMapperOptions:
    return pycolmap.IncrementalMapperOptions(
        num_threads=1, random_seed=1, abs_pose_refine_focal_length=False, abs_pose_refine_extra_params=False
    )


def _triangulated(database: Path, poses: Poses, scratch: Path) -> pycolmap.Reconstruction:
    """COLMAP's own points at our poses of the photographs."""
    with pycolmap.Database.open(database) as opened:
        cache = pycolmap.DatabaseCache.create(opened, pycolmap.DatabaseCacheOptions())
    model = pycolmap.Reconstruction()
    model.load(cache)
    for image in list(model.images.values()):
        model.frames[image.frame_id].rig_from_world = pycolmap.Rigid3d(inverse(poses[image.name])[:3])
        model.register_frame(image.frame_id)
    folder = scratch / "triangulated"
    folder.mkdir()
    options = pycolmap.IncrementalPipelineOptions(
        num_threads=1, extract_colors=False, ba_refine_focal_length=False, ba_refine_extra_params=False
    )
    done = pycolmap.triangulate_points(model, database, scratch, folder, True, options)
    done.write(folder)
    return pycolmap.Reconstruction(folder)


def _registered(database: Path, model: pycolmap.Reconstruction, asked: set[str]) -> Poses:
    with pycolmap.Database.open(database) as opened:
        cache = pycolmap.DatabaseCache.create(opened, pycolmap.DatabaseCacheOptions())
    model.load(cache)
    mapper = pycolmap.IncrementalMapper(cache)
    mapper.begin_reconstruction(model)
    options = _options()
    poses: Poses = {}
    for image_id in [i for i, image in model.images.items() if image.name in asked]:
        if mapper.register_next_image(options, image_id):
            image = model.images[image_id]
            poses[image.name] = inverse(np.vstack([image.cam_from_world().matrix(), [0.0, 0.0, 0.0, 1.0]]))
    return poses


def true_poses(euroc: Path) -> Poses:
    """World_T_camera (4, 4) of both cameras wherever the truth of the first is known."""
    texts = dict(re.findall(r"^.*?(cam[01]) \[([^\]]+)\]", (euroc / "README.md").read_text(), re.MULTILINE))
    body_T = {n: np.vstack([np.array(x.split(","), float).reshape(3, 4), [0, 0, 0, 1]]) for n, x in texts.items()}
    poses: Poses = {}
    for line in (euroc / "world_T_cam0.tum").read_text().splitlines():
        if line.startswith("#"):
            continue
        stamp, *values = line.split()
        pose = np.eye(4)
        pose[:3, 3] = np.array(values[:3], float)
        pose[:3, :3] = Rotation.from_quat(np.array(values[3:], float)).as_matrix()
        for camera in ("cam0", "cam1"):
            poses[f"{camera}/{stamp.replace('.', '')}.jpg"] = pose @ inverse(body_T["cam0"]) @ body_T[camera]
    return poses


def _grey(path: Path) -> NDArray[np.uint8]:
    return np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), np.uint8)


def main() -> None:
    """Print both sides."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("euroc", type=Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        result = compare(arguments.euroc, Path(scratch))
    print(f"photographs: {100 * np.median(result.photograph_errors):.1f} cm median of the truth")
    for name, side, errors in (
        ("ours", result.ours, result.our_errors),
        ("COLMAP", result.colmap, result.colmap_errors),
    ):
        each = 1e3 / result.asked
        print(
            f"{name}: {len(side.poses)} of {result.asked} registered, {100 * np.median(errors):.1f} cm median, "
            f"{100 * np.mean(errors):.1f} mean, {100 * np.max(errors):.1f} worst; of CPU per image "
            f"{each * side.features_s:.0f} ms for features, {each * side.registration_s:.0f} ms for the rest"
        )
    ours, theirs = result.ours, result.colmap
    print(
        f"time of ours over COLMAP's: {ours.seconds / theirs.seconds:.3f}, "
        f"without features {ours.registration_s / theirs.registration_s:.3f}"
    )


if __name__ == "__main__":
    main()
