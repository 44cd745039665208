"""A body in the images of static cameras, by the regions that its surface splits them into (B 2.3-2.4).

A few rounds of lines and Gauss-Newton steps move the body as one, joints closed, from its prediction. The last round's
lines are each camera's measurements of each segment by itself, as those of a body camera, so that the solver weights
them like any other camera.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.surface import BodySurface
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.estimation.factors.joint_keypoints import JointKeypoints
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.geometry import Array, exp_se3, exp_so3, inverse, log_se3
from bodycam_ros.static_cameras.articulated_step import ArticulatedStep, PredictedBody
from bodycam_ros.static_cameras.keypoint_evidence import AgreedKeypoints
from bodycam_ros.static_cameras.limb_search import LimbSearch, chains_of, colours_from, with_usual_limits
from bodycam_ros.static_cameras.region_settings import LINES_ALIKE, MIN_LINES, RegionSettings
from bodycam_ros.static_cameras.segment_support import (
    CONFIRMED,
    CameraSupport,
    SegmentSupport,
    is_far,
    measure_support,
    opposite_rows,
    surface_variances,
)
from bodycam_ros.static_cameras.slid_arm import SlidArms
from bodycam_ros.static_cameras.start_file import START_JOINT_RAD, START_SIGMAS
from bodycam_ros.static_cameras.static_camera import Contour, Image, Mask, RegionEvidence, RegionModel, StaticCamera

_SEED = 1
"""Seed of the random poses of a search: a replay gives the same result each time."""

_VAGUE = 1.0
"""[rad], [m] sigma of what no line measures, such as a limb's long axis: open, but with an inverse."""

_ROUNDS = 4  # of lines and steps for an image; the first are coarse
_COARSE_STRIDE = 4  # [px] of a sample in the first round, half as many in the next: a line then reaches 24 px
_START_ROUNDS = 6  # of updating colours and fitting in the first image
_TRIES, _TRIED_RAD = 14, 0.09  # of arms in the first image, and sigma of their joints about the placed ones
_MIXED = 2.5  # times as many lines count as one while colours are mixed
_RIGID_RAD = 0.01  # of joints while a body that was placed by hand moves as one

_LASTING = 3  # frames in which keypoints have a limb elsewhere: two cameras may exchange left and right at once
_MIN_VIEWS = 2  # cameras needed to search for a limb: one does not measure its distance

Images = Mapping[str, Image]


@dataclass(frozen=True, eq=False)
class _Fit:
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


class RegionTracker:
    """Follows a body in the images of static cameras.

    Args:
        body: segments and joints, with people's usual limits where it has none; with equipment or without.
        surface: of its segments.
        stations: by name.
        settings: rate of learning and least confidence.
        searches_again: whether limbs that are lost are searched for, which takes seconds; else they stay lost.

    Attributes:
        views: camera -> colours of the segments in its images.
    """

    def __init__(
        self,
        body: BodyModel,
        surface: BodySurface,
        stations: Mapping[str, StaticCamera],
        settings: RegionSettings,
        searches_again: bool = True,
    ) -> None:
        body = with_usual_limits(body)
        self.body, self._settings = body, settings
        jointed = np.eye(len(body.segments), dtype=bool)
        jointed[tuple(body.joint_ends.T)] = jointed[tuple(body.joint_ends[:, ::-1].T)] = True
        self.views = {name: RegionModel(station, surface, jointed) for name, station in stations.items()}
        self._step = ArticulatedStep(body)
        self._min_views = _MIN_VIEWS if searches_again else len(stations) + 1
        self._opposite = opposite_rows(body)
        self._all = np.ones(len(body.segments), bool)
        self.restart()

    def restart(self) -> None:
        """Forget all images so far."""
        self._support = SegmentSupport(self.body)
        self._cameras = CameraSupport()
        self._random = np.random.default_rng(_SEED)
        self._arms = SlidArms(self.body)
        self._far_for = np.zeros(len(self.body.segments), np.int64)  # frames that keypoints had a segment elsewhere
        self._forget_colours()

    def initialise(self, images: Images, placed: Array, unplaced: Mask | None = None) -> Array:
        """Measure colours in the first images of a body placed by hand (S, 4, 4); returns its poses, joints closed.

        Colours beside a contour that is some centimetres off are mixed, so they are counted anew as the body is found.
        It moves as one at first: feet are far off where the whole body is turned, and a leg may be taken for the other.
        Segments that were not placed (S,) are searched for, by the colours of their opposite or their parent. Those
        that the images do not support where they are found stay in the N-pose, unobserved, until the images do.
        """
        poses = self._step.close_joints(placed)
        missing = ~self._all if unplaced is None else unplaced
        if missing.any():
            poses, missing = self._search(images, self._fit_start(images, poses, ~missing), missing, ())
            self._forget_colours()
        self._support.unconfirmed = missing
        placed, poses = poses, self._fit_start(images, poses, ~missing)
        if len(images) >= _MIN_VIEWS and (arms := self._weak_arms(images, poses, ~missing)):
            poses = self._fit_start(images, self._best_arms(images, placed, ~missing, arms), ~missing)
        self.update_colours(images, poses)
        return poses

    def _weak_arms(self, images: Images, poses: Array, known: Mask) -> list[list[int]]:
        """Rows of the joints of arms whose forearm the images hardly support in the poses (S, 4, 4)."""
        joints, support = self.body.tree_joints, self.support(images, poses)
        forearms = {f"forearm{side}" for side in ("_left", "_right")}
        return [
            chain
            for chain in chains_of(self.body, known)
            for row in chain
            if joints[row].child in forearms and support[self.body.segment_index[joints[row].child]] < CONFIRMED
        ]

    def _best_arms(self, images: Images, placed: Array, known: Mask, arms: list[list[int]]) -> Array:
        """Poses (S, 4, 4) near those of a body that was placed by hand, with arms where the images explain them best.

        An elbow that is some centimetres off takes colours beside the arm for its own, and fits them: an arm that is
        swung up is lost then. So arms are tried at poses about the placed ones, each try with colours of its own.
        """
        children = [self.body.named(self.body.tree_joints[row].child for row in arm) for arm in arms]
        root, beside = self.body.segment_index[self.body.root], self.body.named(self.body.equipment_segments)
        first = self.body.joint_poses(placed)
        best = first.copy()
        most = np.full(len(arms), -np.inf)
        start = placed

        def at(motion: Array) -> Array:
            return np.where(beside[:, None, None], placed, self.body.forward_kinematics(placed[root], motion))

        for _ in range(_TRIES):
            self._forget_colours()
            poses = self._fit_start(images, start, known)
            self.update_colours(images, poses, 1.0, known)
            explained, _ = self._explain_pixels(images, self._contours(images, poses))
            fitted, tried = self.body.joint_poses(poses), first.copy()
            for each, (arm, segments) in enumerate(zip(arms, children, strict=True)):
                if (pixels := explained[segments].sum()) > most[each]:
                    best[arm], most[each] = fitted[arm], pixels
                turns = exp_so3(_TRIED_RAD * self._random.normal(size=(len(arm), 3)))
                tried[arm, :3, :3] = tried[arm, :3, :3] @ turns
            start = at(tried)
        self._forget_colours()
        return at(best)

    def _forget_colours(self) -> None:
        for view in self.views.values():
            view.replace_colours(0.0)

    def _fit_start(self, images: Images, placed: Array, known: Mask) -> Array:
        """Poses (S, 4, 4) of a body that was placed by hand, by the colours of some segments (S,)."""
        firm = _MIXED**-0.5
        predicted = PredictedBody(placed, firm * START_SIGMAS, firm * _RIGID_RAD)
        poses = placed
        for turn in range(_START_ROUNDS):
            if turn == _START_ROUNDS // 2:
                predicted = PredictedBody(poses, firm * START_SIGMAS, firm * START_JOINT_RAD)
            self.update_colours(images, poses, 1.0 if turn == 0 else 0.5, known)
            poses = self._fit(images, poses, predicted, (), ~known).poses
        return poses

    def update_colours(self, images: Images, poses: Array, rate: float = 1.0, which: Mask | None = None) -> None:
        """Update the colours of some segments (S,), or all, in images of a body at poses (S, 4, 4)."""
        poses = self._step.close_joints(poses)
        for name, image in images.items():
            view = self.views[name]
            view.update_colours(image, view.find_contour(poses), rate, self._all if which is None else which)

    def find_limbs(self, images: Images, poses: Array, known: Collection[SegmentPose]) -> Array:
        """Poses (S, 4, 4) of a body with some known segments; the others are searched for in the images."""
        missing = ~self.body.named([*(each.segment for each in known), *self.body.equipment_segments])
        poses = self._step.close_joints(poses)
        self.update_colours(images, poses, 1.0, ~missing)
        poses, _ = self._search(images, poses, missing, known)
        self.update_colours(images, poses)
        return poses

    def _search(
        self, images: Images, poses: Array, missing: Mask, known: Collection[SegmentPose]
    ) -> tuple[Array, Mask]:
        """Poses (S, 4, 4) with the missing segments (S,) where the images have their colours, and those still missing.

        Still missing are segments that the images do not support there; they stay at the given poses.
        """
        found, unknown = poses, missing

        def energy(tried: Array) -> float:
            return float(self._explain_pixels(images, self._contours(images, tried))[0].sum())

        def refine(tried: Array) -> Array:
            return self._fit(images, tried, PredictedBody.near(tried), known, unknown).poses

        search = LimbSearch(self.body, energy, refine, self._random)
        for chain in chains_of(self.body, missing):
            for view in self.views.values():
                view.copy_colours(colours_from(self.body, unknown))
            limb = self.body.named(self.body.tree_joints[row].child for row in chain)
            unknown = unknown & ~limb
            found = search.find(found, chain)
            self.update_colours(images, found, 1.0, limb)
        fit = self._fit(images, found, PredictedBody.near(found), known, unknown)
        support = self._measure_support(images, fit)
        still = self._support.with_descendants(missing & ~(support >= CONFIRMED), missing)
        return self._step.close_joints(np.where(still[:, None, None], poses, fit.poses)), still

    def _contours(self, images: Images, poses: Array) -> dict[str, Contour]:
        """Contours of a body at poses (S, 4, 4) in images."""
        return {name: self.views[name].find_contour(poses) for name in images}

    def _explain_pixels(self, images: Images, contours: Mapping[str, Contour]) -> Array:
        """(2, S) pixels of all images that segments explain, and all of theirs."""
        parts = [self.views[name].explain_pixels(image, contours[name]) for name, image in images.items()]
        explained: Array = np.sum(parts, axis=0)
        return explained

    def support(self, images: Images, poses: Array) -> Array:
        """Support (S,) of the segments of a body at poses (S, 4, 4) in images; NaN of hidden ones.

        Colours must be known. From ``CONFIRMED`` on a segment is where the images show it.
        """
        poses = self._step.close_joints(poses)
        contours = self._contours(images, poses)
        measured = {name: self.views[name].measure(image, contours[name], 1) for name, image in images.items()}
        return self._measure_support(images, _Fit(poses, poses, measured, contours))

    def _measure_support(self, images: Images, fit: _Fit) -> Array:
        """Support (S,) of the segments in all images; NaN of hidden ones."""
        return measure_support(fit.measured.values(), *self._explain_pixels(images, fit.contours))

    def _update_support(self, images: Images, fit: _Fit) -> None:
        parts = [
            self.views[name].explain_by(image, fit.contours[name], self._opposite) for name, image in images.items()
        ]
        alike = measure_support(fit.measured.values(), *np.sum(parts, axis=0))
        self._support.update(self._measure_support(images, fit), alike)

    def measure(
        self,
        images: Images,
        predicted: PredictedBody,
        known: Collection[SegmentPose] = (),
        agreed: AgreedKeypoints | None = None,
    ) -> StaticMeasurement:
        """Measure the body in images of one frame, by camera (H, W, 3), blue, green, red.

        Args:
            images: of the frame; one or more.
            predicted: the body's prediction.
            known: other measurements of some segments, which the body as a whole takes into account.
            agreed: keypoints in the images, likewise.
        """
        agreed = agreed or AgreedKeypoints.nothing()
        for name in images:
            view = self.views[name]
            view.copy_unknown_colours(other for other in self.views.values() if other is not view)
        start = expected = self._step.close_joints(predicted.world_T_segment)
        on_body = self.body.named(each.segment for each in known)
        far = agreed.far_from(start)
        self._far_for = np.where(far, self._far_for + 1, 0)
        jumped = (self._far_for >= _LASTING) & ~on_body
        agreed = agreed.without(far & ~jumped)
        if jumped.any():
            # Keypoints have limbs elsewhere, and not for a moment: they are taken there, and the contours fit them.
            start, jumped = agreed.move_limbs(self._step, start, PredictedBody.near(start), jumped)
            predicted = PredictedBody.near(start)
            self._support.start_again(jumped)

        def refit(near: Array) -> _Fit:
            return self._fit(images, near, PredictedBody.near(near), known, self._support.unconfirmed, agreed.keypoints)

        fit = self._fit(images, start, predicted, known, self._support.unconfirmed, agreed.keypoints)
        if len(images) >= self._min_views:
            slid = self._arms.find(
                fit.poses,
                on_body | self._support.unconfirmed,
                lambda tried: self._explain_pixels(images, self._contours(images, tried)),
                lambda tried: refit(tried).poses,
            )
            if slid is not None:
                fit = refit(slid.poses)
                jumped[slid.arm] = True
        self._update_support(images, fit)
        if len(images) >= self._min_views and (missing := self._support.next_search() & ~on_body).any():
            colours = {name: view.colours for name, view in self.views.items()}
            poses, still = self._search(images, fit.poses, missing, known)
            found = missing & ~still
            jumped = jumped | found
            if found.any():
                self._support.start_again(found)
                fit = refit(poses)
                self._update_support(images, fit)
            else:
                for name, view in self.views.items():
                    view.replace_colours(colours[name])
        self._cameras.update(fit.measured)
        misplaced = self._cameras.misplaced
        seen = {
            name: (regions.lines >= MIN_LINES)
            & (regions.confidence >= self._settings.least_confidence)
            & ~self._support.unconfirmed
            & (name not in misplaced)
            for name, regions in fit.measured.items()
        }
        by_any = np.any([*seen.values()], axis=0)
        for name, image in images.items():
            view = self.views[name]
            contour = view.propagate_contour(fit.contours[name], fit.poses)
            view.update_colours(image, contour, self._settings.learning_rate, seen[name] | (by_any & ~view.has_colours))
        far = agreed.far_from(fit.poses)
        unsupported = (self._support.unsupported | far) & ~on_body
        return StaticMeasurement(
            {name: self._evidence(fit.before, regions, seen[name]) for name, regions in fit.measured.items()},
            fit.poses,
            {name: regions.confidence for name, regions in fit.measured.items()},
            frozenset(np.flatnonzero(jumped).tolist()),
            frozenset(np.flatnonzero(unsupported).tolist()),
            misplaced,
            surface_variances(self.body),
            agreed.keypoints,
            frozenset(np.flatnonzero(jumped & ~on_body & is_far(fit.poses, expected)).tolist()),
            frozenset(np.flatnonzero(unsupported & self._support.not_yet_shown & ~far).tolist()),
        )

    def _fit(
        self,
        images: Images,
        start: Array,
        predicted: PredictedBody,
        known: Collection[SegmentPose],
        excluded: Mask,
        keypoints: JointKeypoints | None = None,
    ) -> _Fit:
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
            poses = self._step.apply(poses, information, vector, predicted)
        return _Fit(poses, before, measured, contours)

    def _equations(
        self,
        measured: Mapping[str, RegionEvidence],
        poses: Array,
        known: Collection[SegmentPose],
        excluded: Mask,
    ) -> tuple[Array, Array]:
        """Normal equations (S, 6, 6), (S, 6) of all cameras and known segments, at poses (S, 4, 4)."""
        misplaced = self._cameras.misplaced
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

    def _evidence(self, before: Array, regions: RegionEvidence, seen: Mask) -> list[SegmentPose]:
        """One camera's condensed poses, linearised at poses (S, 4, 4); what no line measures has a wide sigma."""
        covariances = np.linalg.inv(regions.information[seen] / LINES_ALIKE + _VAGUE**-2.0 * np.eye(6))
        poses = before[seen] @ exp_se3((covariances @ (regions.vector[seen] / LINES_ALIKE)[..., None])[..., 0])
        names = [self.body.segments[row] for row in np.flatnonzero(seen)]
        return [SegmentPose(*each) for each in zip(names, poses, covariances, strict=True)]
