"""A body fitted to the regions that its surface splits the images of static cameras into (B 2.3-2.4).

A few rounds of lines and Gauss-Newton steps move the body as one, joints closed, from its prediction.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.surface import BodySurface
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.estimation.factors.joint_keypoints import JointKeypoints
from bodycam_ros.geometry import Array, inverse, log_se3
from bodycam_ros.static_cameras.articulated_step import ArticulatedStep, PredictedBody
from bodycam_ros.static_cameras.region_settings import LINES_ALIKE
from bodycam_ros.static_cameras.segment_support import CameraSupport, measure_support, opposite_rows
from bodycam_ros.static_cameras.static_camera import Contour, Image, Mask, RegionEvidence, RegionModel, StaticCamera

_ROUNDS = 4  # of lines and steps for an image; the first are coarse
_COARSE_STRIDE = 4  # [px] of a sample in the first round, half as many in the next: a line then reaches 24 px

Images = Mapping[str, Image]


@dataclass(frozen=True, eq=False)
class RegionFit:
    """The body after all rounds of lines and steps.

    Attributes:
        poses, before: (S, 4, 4), and before the last round.
        measured: camera -> evidence at the poses before.
        contours: camera -> contour of the body there.
    """

    poses: Array
    before: Array
    measured: dict[str, RegionEvidence]
    contours: dict[str, Contour]


class RegionFitter:
    """Fits a body to the images of a frame by the colours of its segments, and measures how well they support it.

    Args:
        body: segments and joints; with equipment or without.
        surface: of its segments.
        stations: static cameras by name.

    Attributes:
        body: as given.
        step: a Gauss-Newton step of it.
        views: camera -> colours of the segments in its images.
        cameras: how well each camera supports the body; misplaced ones do not count in a fit.
    """

    def __init__(self, body: BodyModel, surface: BodySurface, stations: Mapping[str, StaticCamera]) -> None:
        self.body = body
        jointed = np.eye(len(body.segments), dtype=bool)
        jointed[tuple(body.joint_ends.T)] = jointed[tuple(body.joint_ends[:, ::-1].T)] = True
        self.views = {name: RegionModel(station, surface, jointed) for name, station in stations.items()}
        self.step = ArticulatedStep(body)
        self._opposite = opposite_rows(body)
        self._all = np.ones(len(body.segments), bool)
        self.restart()

    def restart(self) -> None:
        """Forget all images so far."""
        self.cameras = CameraSupport()
        self.forget_colours()

    def forget_colours(self) -> None:
        """Forget the colours of all segments."""
        for view in self.views.values():
            view.replace_colours(0.0)

    def update_colours(self, images: Images, poses: Array, rate: float = 1.0, which: Mask | None = None) -> None:
        """Update the colours of some segments (S,), or all, in images of a body at poses (S, 4, 4)."""
        poses = self.step.close_joints(poses)
        for name, image in images.items():
            view = self.views[name]
            view.update_colours(image, view.find_contour(poses), rate, self._all if which is None else which)

    def fit(
        self,
        images: Images,
        start: Array,
        predicted: PredictedBody,
        known: Collection[SegmentPose],
        excluded: Mask,
        keypoints: JointKeypoints | None = None,
    ) -> RegionFit:
        """Fit the body to its regions from poses (S, 4, 4), without excluded segments (S,) and misplaced cameras."""
        poses = before = start
        measured: dict[str, RegionEvidence] = {}
        contours: dict[str, Contour] = {}
        for turn in range(_ROUNDS):
            stride = max(1, _COARSE_STRIDE >> turn)
            for name, image in images.items():
                view = self.views[name]
                contours[name] = (
                    view.propagate_contour(contours[name], poses) if name in contours else view.find_contour(poses)
                )
                measured[name] = view.measure(image, contours[name], stride)
            before = poses
            information, vector = self._equations(measured, poses, known, excluded)
            if keypoints is not None:
                by_keypoints = keypoints.equations(poses)
                information, vector = information + by_keypoints[0], vector + by_keypoints[1]
            poses = self.step.apply(poses, information, vector, predicted)
        return RegionFit(poses, before, measured, contours)

    def _equations(
        self,
        measured: Mapping[str, RegionEvidence],
        poses: Array,
        known: Collection[SegmentPose],
        excluded: Mask,
    ) -> tuple[Array, Array]:
        """Normal equations (S, 6, 6), (S, 6) of all cameras and known segments, at poses (S, 4, 4)."""
        misplaced = self.cameras.misplaced
        used = [regions for name, regions in measured.items() if name not in misplaced]
        information = sum((each.information for each in used), np.zeros((len(poses), 6, 6))) / LINES_ALIKE
        vector = sum((each.vector for each in used), np.zeros((len(poses), 6))) / LINES_ALIKE
        information[excluded], vector[excluded] = 0.0, 0.0
        for segment in known:
            row = self.body.segment_index[segment.segment]
            weight = np.linalg.inv(segment.covariance)
            information[row] += weight
            vector[row] += weight @ log_se3(inverse(poses[row]) @ segment.world_T_segment)
        return information, vector

    def explain(self, images: Images, poses: Array) -> Array:
        """(2, S) pixels of all images that segments at poses (S, 4, 4) explain, and all of theirs."""
        return self._explain(images, {name: self.views[name].find_contour(poses) for name in images})

    def _explain(self, images: Images, contours: Mapping[str, Contour]) -> Array:
        parts = [self.views[name].explain_pixels(image, contours[name]) for name, image in images.items()]
        explained: Array = np.sum(parts, axis=0)
        return explained

    def support_at(self, images: Images, poses: Array) -> Array:
        """Support (S,) of the segments of a body at poses (S, 4, 4) in images; NaN of hidden ones.

        Colours must be known. From ``CONFIRMED`` on a segment is where the images show it.
        """
        poses = self.step.close_joints(poses)
        contours = {name: self.views[name].find_contour(poses) for name in images}
        measured = {name: self.views[name].measure(image, contours[name], 1) for name, image in images.items()}
        return self.support(images, RegionFit(poses, poses, measured, contours))

    def support(self, images: Images, fit: RegionFit) -> Array:
        """Support (S,) of the segments in all images; NaN of hidden ones."""
        return measure_support(fit.measured.values(), *self._explain(images, fit.contours))

    def support_alike(self, images: Images, fit: RegionFit) -> Array:
        """The same (S,) by the colours of the opposite limbs."""
        parts = [
            self.views[name].explain_by(image, fit.contours[name], self._opposite) for name, image in images.items()
        ]
        return measure_support(fit.measured.values(), *np.sum(parts, axis=0))
