"""Cameras followed by us, beside OpenCV: python -m benchmarks.against_opencv RECORDING --map MAP.

RECORDING holds ``bag`` and ``truth/cameras``. OpenCV follows the landmarks of our first registration by its pyramid of
Lucas and Kanade, and fits each pose by its PnP with RANSAC; where too few are left it is given those of ours again.
Both sides have the same images, one thread, and are held to the same truth.
"""

import argparse
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.formats.tum import read_tum
from bodycam_ros.geometry import Array, inverse, log_so3, rigid, umeyama
from bodycam_ros.kernels import load_kernels
from bodycam_ros.pipeline.camera_front import CameraFront
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap

_LEAST = 12  # landmarks of a pose, as of ours
_FORWARD = 0.2  # least cosine to the optical axis: PnP has an image plane, which a fisheye leaves
_ERROR_PX = 2.0


@dataclass
class Side:
    """One side: camera and stamp [ns] -> world_T_camera (4, 4), and the processor's time for them [s]."""

    poses: dict[tuple[str, int], Array] = field(default_factory=dict)
    seconds: float = 0.0


class OpenCvTracker:
    """Landmarks followed from image to image by OpenCV alone."""

    def __init__(self, camera: CameraModel) -> None:
        self._camera = camera
        self._image: NDArray[np.uint8] | None = None
        self._pixels, self._points = np.zeros((0, 2), np.float32), np.zeros((0, 3))

    def begin(self, image: NDArray[np.uint8], matches: LandmarkMatches) -> None:
        """Follow the landmarks of one registered image (H, W)."""
        self._image = image
        self._pixels = matches.pixels
        self._points = matches.points_world.astype(np.float64)

    def track(self, image: NDArray[np.uint8]) -> Array | None:
        """The pose (4, 4) of the next image; None where too few landmarks are left."""
        before, self._image = self._image, image
        if before is None or len(self._pixels) < _LEAST:
            return None
        pixels, found, _ = cv2.calcOpticalFlowPyrLK(before, image, self._pixels, None)
        bearings, valid = self._camera.unproject(pixels)
        keep = (found.ravel() == 1) & valid & (bearings[:, 2] > _FORWARD)
        self._pixels = pixels[keep]
        self._points = self._points[keep]
        bearings = bearings[keep]
        if keep.sum() < _LEAST:
            return None
        plane, K = bearings[:, :2] / bearings[:, 2:], np.eye(3)
        done, rvec, tvec, inliers = cv2.solvePnPRansac(
            self._points, plane, K, None, reprojectionError=_ERROR_PX / self._camera.fx, flags=cv2.SOLVEPNP_AP3P
        )
        if not done or inliers is None or len(inliers) < _LEAST:
            return None
        rows = inliers.ravel()
        self._pixels, self._points = self._pixels[rows], self._points[rows]
        rvec, tvec = cv2.solvePnPRefineLM(self._points, plane[rows], K, None, rvec, tvec)
        return inverse(rigid(cv2.Rodrigues(rvec)[0], tvec.ravel()))


def compare(recording_path: Path, map_path: Path) -> tuple[Side, Side, int, int]:
    """Our side and OpenCV's, the number of images, and how often OpenCV's began anew."""
    reference_map = ReferenceMap.load(map_path)
    ours = Side()
    theirs = Side()
    images = 0
    begun = 0
    with threadpool_limits(1), open_recording(recording_path / "bag") as recording:
        for name in recording.cameras:
            camera = recording.camera_model(name)
            pipeline, tracker = CameraFront(camera, reference_map, PipelineSettings()), OpenCvTracker(camera)
            follows = False
            for image in recording.images([name]):
                images += 1
                started_s = time.process_time()
                grey = decode_grey(image)
                decoded_s = time.process_time()
                _, matches, _ = pipeline.process(grey, image.stamp_ns)
                ours.seconds += time.process_time() - started_s
                if matches.world_T_camera is not None:
                    ours.poses[name, image.stamp_ns] = matches.world_T_camera
                tracked_s = time.process_time()
                pose = tracker.track(grey) if follows else None
                theirs.seconds += time.process_time() - tracked_s + decoded_s - started_s
                follows = pose is not None
                if pose is not None:
                    theirs.poses[name, image.stamp_ns] = pose
                elif matches.world_T_camera is not None:
                    tracker.begin(grey, matches)
                    follows, begun = True, begun + 1
    return ours, theirs, images, begun


def true_poses(recording_path: Path) -> dict[tuple[str, int], Array]:
    """Camera and stamp [ns] -> true world_T_camera (4, 4)."""
    poses: dict[tuple[str, int], Array] = {}
    for path in sorted((recording_path / "truth/cameras").glob("*.tum")):
        stamps_ns, world_T_camera = read_tum(path)
        poses |= {(path.stem, int(stamp)): pose for stamp, pose in zip(stamps_ns, world_T_camera, strict=True)}
    return poses


def errors(
    poses: Mapping[tuple[str, int], Array], truth: Mapping[tuple[str, int], Array], world_T_map: Array
) -> tuple[Array, Array]:
    """Errors (N,) of each pose's position [mm] and rotation [deg]."""
    known = [key for key in poses if key in truth]
    off = np.array([inverse(truth[key]) @ world_T_map @ poses[key] for key in known])
    return 1e3 * np.linalg.norm(off[:, :3, 3], axis=1), np.degrees(np.linalg.norm(log_so3(off[:, :3, :3]), axis=1))


def main() -> None:
    """Print both sides."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--map", type=Path, required=True)
    arguments = parser.parse_args()
    load_kernels()
    cv2.setNumThreads(1)
    ours, theirs, images, begun = compare(arguments.recording, arguments.map)
    truth = true_poses(arguments.recording)
    known = [key for key in ours.poses if key in truth]
    _, R, t = umeyama(
        np.array([ours.poses[key][:3, 3] for key in known]),
        np.array([truth[key][:3, 3] for key in known]),
        with_scale=False,
    )
    for name, side in (("ours", ours), ("OpenCV", theirs)):
        off_mm, off_deg = errors(side.poses, truth, rigid(R, t))
        print(
            f"{name}: {len(side.poses)} of {images} images, {1e3 * side.seconds / images:.2f} ms of CPU an image; "
            f"off by {off_mm.mean():.2f} mm mean, {np.percentile(off_mm, 95):.2f} p95, {off_mm.max():.1f} worst, "
            f"{off_deg.mean():.3f} deg mean"
        )
    print(f"OpenCV was given our landmarks {begun} times")


if __name__ == "__main__":
    main()
