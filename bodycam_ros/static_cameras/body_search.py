"""Finds a body in images of static cameras: from a pose by hand, and limbs whose pose is unknown (B eq. 8)."""

from collections.abc import Collection

import numpy as np

from bodycam_ros.body_state import SegmentPose
from bodycam_ros.geometry import Array, exp_so3
from bodycam_ros.static_cameras.articulated_step import PredictedBody
from bodycam_ros.static_cameras.limb_search import LimbSearch, chains_of, colours_from
from bodycam_ros.static_cameras.region_fit import Images, RegionFitter
from bodycam_ros.static_cameras.segment_support import CONFIRMED, with_descendants
from bodycam_ros.static_cameras.start_file import START_JOINT_RAD, START_SIGMAS
from bodycam_ros.static_cameras.static_camera import Mask

MIN_VIEWS = 2
"""Cameras needed to search for a limb: one does not measure its distance."""

_SEED = 1
"""Seed of the random poses of a search: a replay gives the same result each time."""

_START_ROUNDS = 6  # of updating colours and fitting in the first image
_TRIES, _TRIED_RAD = 14, 0.09  # of arms in the first image, and sigma of their joints about the placed ones
_MIXED = 2.5  # times as many lines count as one while colours are mixed
_RIGID_RAD = 0.01  # of joints while a body that was placed by hand moves as one


class BodySearch:
    """Finds a body, or limbs of it, in the images of a frame.

    Args:
        fitter: of the body to images.
    """

    def __init__(self, fitter: RegionFitter) -> None:
        self._fitter, self._body = fitter, fitter.body
        self._all = np.ones(len(self._body.segments), bool)
        self.restart()

    def restart(self) -> None:
        """Try the same poses again."""
        self._random = np.random.default_rng(_SEED)

    def start(self, images: Images, placed: Array, unplaced: Mask | None = None) -> tuple[Array, Mask]:
        """Measure colours in the first images of a body placed by hand (S, 4, 4).

        Colours beside a contour that is some centimetres off are mixed, so they are counted anew as the body is found.
        It moves as one at first: feet are far off where the whole body is turned, and a leg may be taken for the other.
        Segments that were not placed (S,) are searched for, by the colours of their opposite or their parent. Those
        that the images do not support where they are found stay in the N-pose, unobserved, until the images do.

        Returns:
            Its poses (S, 4, 4), joints closed, and the segments (S,) that were not found.
        """
        poses = self._fitter.step.close_joints(placed)
        missing = ~self._all if unplaced is None else unplaced
        if missing.any():
            poses, missing = self.find(images, self._fit_placed(images, poses, ~missing), missing, ())
            self._fitter.forget_colours()
        placed, poses = poses, self._fit_placed(images, poses, ~missing)
        if len(images) >= MIN_VIEWS and (arms := self._weak_arms(images, poses, ~missing)):
            poses = self._fit_placed(images, self._best_arms(images, placed, ~missing, arms), ~missing)
        self._fitter.update_colours(images, poses)
        return poses, missing

    def _weak_arms(self, images: Images, poses: Array, known: Mask) -> list[list[int]]:
        """Rows of the joints of arms whose forearm the images hardly support in the poses (S, 4, 4)."""
        joints, support = self._body.tree_joints, self._fitter.support_at(images, poses)
        forearms = {f"forearm{side}" for side in ("_left", "_right")}
        return [
            chain
            for chain in chains_of(self._body, known)
            for row in chain
            if joints[row].child in forearms and support[self._body.segment_index[joints[row].child]] < CONFIRMED
        ]

    def _best_arms(self, images: Images, placed: Array, known: Mask, arms: list[list[int]]) -> Array:
        """Poses (S, 4, 4) near those of a body that was placed by hand, with arms where the images explain them best.

        An elbow that is some centimetres off takes colours beside the arm for its own, and fits them: an arm that is
        swung up is lost then. So arms are tried at poses about the placed ones, each try with colours of its own.
        """
        children = [self._body.named(self._body.tree_joints[row].child for row in arm) for arm in arms]
        root, beside = self._body.segment_index[self._body.root], self._body.named(self._body.equipment_segments)
        first = self._body.joint_poses(placed)
        best = first.copy()
        most = np.full(len(arms), -np.inf)
        start = placed

        def at(motion: Array) -> Array:
            return np.where(beside[:, None, None], placed, self._body.forward_kinematics(placed[root], motion))

        for _ in range(_TRIES):
            self._fitter.forget_colours()
            poses = self._fit_placed(images, start, known)
            self._fitter.update_colours(images, poses, 1.0, known)
            explained, _ = self._fitter.explain(images, poses)
            fitted, tried = self._body.joint_poses(poses), first.copy()
            for each, (arm, segments) in enumerate(zip(arms, children, strict=True)):
                if (pixels := explained[segments].sum()) > most[each]:
                    best[arm], most[each] = fitted[arm], pixels
                turns = exp_so3(_TRIED_RAD * self._random.normal(size=(len(arm), 3)))
                tried[arm, :3, :3] = tried[arm, :3, :3] @ turns
            start = at(tried)
        self._fitter.forget_colours()
        return at(best)

    def _fit_placed(self, images: Images, placed: Array, known: Mask) -> Array:
        """Poses (S, 4, 4) of a body that was placed by hand, by the colours of some segments (S,)."""
        firm = _MIXED**-0.5
        predicted = PredictedBody(placed, firm * START_SIGMAS, firm * _RIGID_RAD)
        poses = placed
        for turn in range(_START_ROUNDS):
            if turn == _START_ROUNDS // 2:
                predicted = PredictedBody(poses, firm * START_SIGMAS, firm * START_JOINT_RAD)
            self._fitter.update_colours(images, poses, 1.0 if turn == 0 else 0.5, known)
            poses = self._fitter.fit(images, poses, predicted, (), ~known).poses
        return poses

    def find_limbs(self, images: Images, poses: Array, known: Collection[SegmentPose]) -> Array:
        """Poses (S, 4, 4) of a body with some known segments; the others are searched for in the images."""
        missing = ~self._body.named([*(each.segment for each in known), *self._body.equipment_segments])
        poses = self._fitter.step.close_joints(poses)
        self._fitter.update_colours(images, poses, 1.0, ~missing)
        poses, _ = self.find(images, poses, missing, known)
        self._fitter.update_colours(images, poses)
        return poses

    def find(self, images: Images, poses: Array, missing: Mask, known: Collection[SegmentPose]) -> tuple[Array, Mask]:
        """Poses (S, 4, 4) with the missing segments (S,) where the images have their colours, and those still missing.

        Still missing are segments that the images do not support there; they stay at the given poses.
        """
        found, unknown = poses, missing

        def energy(tried: Array) -> float:
            return float(self._fitter.explain(images, tried)[0].sum())

        def refine(tried: Array) -> Array:
            return self._fitter.fit(images, tried, PredictedBody.near(tried), known, unknown).poses

        search = LimbSearch(self._body, energy, refine, self._random)
        for chain in chains_of(self._body, missing):
            for view in self._fitter.views.values():
                view.copy_colours(colours_from(self._body, unknown))
            limb = self._body.named(self._body.tree_joints[row].child for row in chain)
            unknown = unknown & ~limb
            found = search.find(found, chain)
            self._fitter.update_colours(images, found, 1.0, limb)
        fit = self._fitter.fit(images, found, PredictedBody.near(found), known, unknown)
        support = self._fitter.support(images, fit)
        still = with_descendants(self._body, missing & ~(support >= CONFIRMED), missing)
        return self._fitter.step.close_joints(np.where(still[:, None, None], poses, fit.poses)), still
