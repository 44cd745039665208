"""A body in the images of static cameras, by the regions that its surface splits them into (B 2.3-2.4).

Each frame is fitted from its prediction (``region_fit.py``), and lost limbs are searched for (``body_search.py``). The
last round's lines are each camera's measurements of each segment by itself, as those of a body camera, so that the
solver weights them like any other camera.
"""

from collections.abc import Collection, Mapping
from functools import partial

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.surface import BodySurface
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.geometry import Array, exp_se3
from bodycam_ros.static_cameras.articulated_step import PredictedBody
from bodycam_ros.static_cameras.body_search import MIN_VIEWS, BodySearch
from bodycam_ros.static_cameras.keypoint_evidence import AgreedKeypoints
from bodycam_ros.static_cameras.limb_search import with_usual_limits
from bodycam_ros.static_cameras.region_fit import Images, RegionFit, RegionFitter
from bodycam_ros.static_cameras.region_settings import LINES_ALIKE, MIN_LINES, RegionSettings
from bodycam_ros.static_cameras.segment_support import SegmentSupport, is_far, surface_variances
from bodycam_ros.static_cameras.slid_arm import SlidArms
from bodycam_ros.static_cameras.static_camera import Mask, RegionEvidence, StaticCamera

_VAGUE = 1.0
"""[rad], [m] sigma of what no line measures, such as a limb's long axis: open, but with an inverse."""

_LASTING = 3  # frames in which keypoints have a limb elsewhere: two cameras may exchange left and right at once


class RegionTracker:
    """Follows a body in the images of static cameras.

    Args:
        body: segments and joints, with people's usual limits where it has none; with equipment or without.
        surface: of its segments.
        stations: by name.
        settings: rate of learning and least confidence.
        searches_again: whether limbs that are lost are searched for, which takes seconds; else they stay lost.
        tries_arms: whether arms that may have slid up a sleeve are tried elsewhere as well.

    Attributes:
        body: as given, with limits.
        views: camera -> colours of the segments in its images.
    """

    def __init__(
        self,
        body: BodyModel,
        surface: BodySurface,
        stations: Mapping[str, StaticCamera],
        settings: RegionSettings,
        searches_again: bool = True,
        tries_arms: bool = True,
    ) -> None:
        self.body, self._settings = with_usual_limits(body), settings
        self._fitter = RegionFitter(self.body, surface, stations)
        self.views = self._fitter.views
        self._search = BodySearch(self._fitter)
        self._min_views = MIN_VIEWS if searches_again else len(stations) + 1
        self._tries_arms = searches_again and tries_arms
        self.restart()

    def restart(self) -> None:
        """Forget all images so far."""
        self._fitter.restart()
        self._search.restart()
        self._support = SegmentSupport(self.body)
        self._arms = SlidArms(self.body)
        self._far_for = np.zeros(len(self.body.segments), np.int64)  # frames that keypoints had a segment elsewhere

    def initialise(self, images: Images, placed: Array, unplaced: Mask | None = None) -> Array:
        """Poses (S, 4, 4) of a body that was placed by hand in the first images, see ``BodySearch.start``."""
        poses, self._support.unconfirmed = self._search.start(images, placed, unplaced)
        return poses

    def find_limbs(self, images: Images, poses: Array, known: Collection[SegmentPose]) -> Array:
        """See ``BodySearch.find_limbs``."""
        return self._search.find_limbs(images, poses, known)

    def support(self, images: Images, poses: Array) -> Array:
        """See ``RegionFitter.support_at``."""
        return self._fitter.support_at(images, poses)

    def _update_support(self, images: Images, fit: RegionFit) -> None:
        self._support.update(self._fitter.support(images, fit), self._fitter.support_alike(images, fit))

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
        start = expected = self._fitter.step.close_joints(predicted.world_T_segment)
        on_body = self.body.named(each.segment for each in known)
        far = agreed.far_from(start)
        self._far_for = np.where(far, self._far_for + 1, 0)
        jumped = (self._far_for >= _LASTING) & ~on_body
        agreed = agreed.without(far & ~jumped)
        if jumped.any():
            # Keypoints have limbs elsewhere, and not for a moment: they are taken there, and the contours fit them.
            start, jumped = agreed.move_limbs(self._fitter.step, start, PredictedBody.near(start), jumped)
            predicted = PredictedBody.near(start)
            self._support.start_again(jumped)

        def fit_from(begin: Array, near: PredictedBody) -> RegionFit:
            return self._fitter.fit(images, begin, near, known, self._support.unconfirmed, agreed.keypoints)

        def refit(begin: Array) -> RegionFit:
            return fit_from(begin, PredictedBody.near(begin))

        fit = fit_from(start, predicted)
        if self._tries_arms and len(images) >= self._min_views:
            slid = self._arms.find(
                fit.poses,
                on_body | self._support.unconfirmed,
                partial(self._fitter.explain, images),
                lambda tried: refit(tried).poses,
            )
            if slid is not None:
                fit = refit(slid.poses)
                jumped[slid.arm] = True
        self._update_support(images, fit)
        if len(images) >= self._min_views and (missing := self._support.next_search() & ~on_body).any():
            colours = {name: view.colours for name, view in self.views.items()}
            poses, still = self._search.find(images, fit.poses, missing, known)
            found = missing & ~still
            jumped = jumped | found
            if found.any():
                self._support.start_again(found)
                fit = refit(poses)
                self._update_support(images, fit)
            else:
                for name, view in self.views.items():
                    view.replace_colours(colours[name])
        self._fitter.cameras.update(fit.measured)
        misplaced = self._fitter.cameras.misplaced
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

    def _evidence(self, before: Array, regions: RegionEvidence, seen: Mask) -> list[SegmentPose]:
        """One camera's condensed poses, linearised at poses (S, 4, 4); what no line measures has a wide sigma."""
        covariances = np.linalg.inv(regions.information[seen] / LINES_ALIKE + _VAGUE**-2.0 * np.eye(6))
        poses = before[seen] @ exp_se3((covariances @ (regions.vector[seen] / LINES_ALIKE)[..., None])[..., 0])
        names = [self.body.segments[row] for row in np.flatnonzero(seen)]
        return [SegmentPose(*each) for each in zip(names, poses, covariances, strict=True)]
