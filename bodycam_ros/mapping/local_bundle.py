"""Bundle adjustment of body cameras' keyframes and the points that they add; the reference structure is fixed (A 4.1).

COLMAP's adjuster does it. Rays become pixels of an equidistant fisheye lens with the camera's focal length, so that
errors are angles and no lens model is needed.
"""

from collections.abc import Iterable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array, inverse

_OUTLIER_PX = 1.0  # errors beyond this count less and less (Cauchy)
_TOLERANCE = 1e-4  # relative decrease of the cost at which it stops
_ITERATIONS = 15
_LEAST_COSINE = 0.05  # of a ray to the optical axis: COLMAP's fisheye ends at 90 degrees
_MIN_OBSERVATIONS = 12  # of a keyframe; a pose that fewer tie stays as it was registered
_WHOLE_TURN = 7.0  # [rad] width of the picture: pixels of all rays are in it


class PosedView(Protocol):
    """An image: pixels per radian of its camera, and the pose (4, 4), which the adjustment replaces."""

    focal_px: float
    world_T_camera: Array


class KeyframeBundle:
    """Observations of some points by keyframes, and of reference landmarks.

    Args:
        points: (P) of (3,) [m], that move.
    """

    def __init__(self, points: Iterable[Array]) -> None:
        self._points = list(points)
        self._moving = len(self._points)
        self._row_of_landmark: dict[int, int] = {}
        self._seen: dict[PosedView, tuple[list[int], list[Array]]] = {}

    def add(self, view: PosedView, point: int, ray: Array) -> None:
        """A view sees a point, by its row, along a unit ray (3,) in the axes of the camera."""
        if ray[2] > _LEAST_COSINE:
            rows, rays = self._seen.setdefault(view, ([], []))
            rows.append(point)
            rays.append(ray)

    def anchor(self, view: PosedView, landmark_ids: NDArray[np.uint32], points: Array, rays: Array) -> None:
        """A view sees reference landmarks (M,) at fixed places (M, 3) [m], along rays (M, 3)."""
        for landmark_id, place, ray in zip(landmark_ids.tolist(), points, rays, strict=True):
            row = self._row_of_landmark.setdefault(landmark_id, len(self._points))
            if row == len(self._points):
                self._points.append(place)
            self.add(view, row, ray)

    def solve(self, moving: Sequence[PosedView]) -> None:
        """Replace the poses of some views by those that fit all observations best; the other views are fixed.

        The same input gives the same poses to the last bit.
        """
        moves = [each for each in moving if len(self._seen.get(each, ([], []))[0]) >= _MIN_OBSERVATIONS]
        if not moves:
            return
        # Here, so that the settings can be read without loading pycolmap.
        from bodycam_ros.camera.colmap_model import pycolmap

        model, config = pycolmap.Reconstruction(), pycolmap.BundleAdjustmentConfig()
        camera_of: dict[float, int] = {}
        for view in self._seen:
            if view.focal_px not in camera_of:
                number = camera_of[view.focal_px] = len(camera_of) + 1
                width, lens = int(_WHOLE_TURN * view.focal_px), [view.focal_px, 0.0, 0.0]
                camera = pycolmap.Camera(
                    model="SIMPLE_FISHEYE", width=width, height=width, params=lens, camera_id=number
                )
                model.add_camera_with_trivial_rig(camera)
                config.set_constant_cam_intrinsics(number)
        tracks: dict[int, pycolmap.Track] = {}

        def add_image(number: int, view: PosedView, rows: Sequence[int], pixels: Array) -> None:
            image = pycolmap.Image(
                name=str(number), keypoints=pixels, camera_id=camera_of[view.focal_px], image_id=number
            )
            model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(inverse(view.world_T_camera)[:3]))
            for feature, row in enumerate(rows):
                tracks.setdefault(row, pycolmap.Track()).add_element(number, feature)

        for number, (view, (rows, rays)) in enumerate(self._seen.items(), start=1):
            add_image(number, view, rows, view.focal_px * _equidistant(np.array(rays)))
            config.add_image(number)
            if view not in moves:
                config.set_constant_rig_from_world_pose(model.image(number).frame_id)
        # COLMAP refuses points with one view. The reference structure's were seen by photographs, too.
        lonely = [row for row, track in tracks.items() if track.length() < 2]
        add_image(len(self._seen) + 1, next(iter(self._seen)), lonely, np.zeros((len(lonely), 2)))
        for row, track in tracks.items():
            model.add_point3D_with_id(row, pycolmap.Point3D(xyz=self._points[row], track=track))
            if row >= self._moving:
                config.add_constant_point(row)
        options = pycolmap.BundleAdjustmentOptions(print_summary=False)
        options.ceres.solver_options.num_threads = 1  # sums of several threads depend on their order
        options.ceres.solver_options.max_num_iterations = _ITERATIONS
        options.ceres.solver_options.function_tolerance = _TOLERANCE
        options.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
        options.ceres.loss_function_scale = _OUTLIER_PX
        pycolmap.create_default_bundle_adjuster(options, config, model).solve()
        for number, view in enumerate(self._seen, start=1):
            if view in moves:
                camera_T_world = np.vstack([model.image(number).cam_from_world().matrix(), [0.0, 0.0, 0.0, 1.0]])
                view.world_T_camera = inverse(camera_T_world)


def _equidistant(rays: Array) -> Array:
    """(O, 2) directions from the optical axis, as long as their angles to it [rad], of unit rays (O, 3)."""
    across = np.linalg.norm(rays[:, :2], axis=1)
    angles = np.arctan2(across, rays[:, 2])
    scaled: Array = rays[:, :2] * (angles / np.maximum(across, 1e-12))[:, None]
    return scaled
