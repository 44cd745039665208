"""A body in the images of static cameras, by the regions that its surface splits them into (B 2.3-2.4).

A few rounds of lines and Gauss-Newton steps move the body as one, joints closed, from its prediction. The last round's
lines are each camera's measurements of each segment by itself, as those of a body camera, so that the solver weights
them like any other camera.
"""

from collections.abc import Collection, Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.calibration.anthropometry import SegmentName
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3
from bodycam_ros.static_cameras.articulated_step import ArticulatedStep, PredictedBody
from bodycam_ros.static_cameras.body_shape import BodySurface
from bodycam_ros.static_cameras.limb_search import LimbSearch, colours_from, with_usual_limits
from bodycam_ros.static_cameras.region_settings import LINES_ALIKE, RegionSettings
from bodycam_ros.static_cameras.start_file import START_JOINT_RAD, START_SIGMAS
from bodycam_ros.static_cameras.station import Contour, Image, LossDetector, RegionEvidence, RegionModel, Station

_LOOSE = np.repeat([0.3, 0.05], 3)
"""[rad], [m] deviation of a tried pose from where the images have the segment."""

_SEED = 1
"""Of the random poses of a search: a replay gives the same result each time."""

_VAGUE = 1.0
"""[rad], [m] sigma of what no line measures, such as a limb's long axis: open, but with an inverse."""

_ROUNDS = 4  # of lines and steps for an image; the first are coarse
_COARSE_STRIDE = 4  # [px] of a sample in the first round, half as many in the next: a line then reaches 24 px
_MIN_LINES = 4  # that measure something; a segment with fewer is unobserved by a camera
_START_ROUNDS = 6  # of learning colours and fitting in the first image
_MIXED = 2.5  # times as many lines count as one while colours are mixed
_RIGID_RAD = 0.01  # of joints while a body that was placed by hand moves as one

_SUPPORT_RATE = 0.1  # share of an instant in a smoothed support
_MIN_SUPPORT, _MIN_END_SUPPORT = 0.4, 0.33
"""Support below which a segment is taken to be elsewhere, and the same of heads, hands and feet. Segments that were off
by 15 cm and more had 0.25 to 0.47, right ones 0.49 to 1, ends of the body 0.38 to 1."""

_CONFIRMED = 0.62  # support from which on a segment that was searched for is confirmed

_LIMB_SIGMAS = (0.05, 0.05, 0.12, 0.01, 0.01, 0.01)
_SURFACE_SIGMAS = {
    "head": (0.13, 0.1, 0.5, 0.01, 0.01, 0.01),
    "torso": (0.07, 0.1, 0.1, 0.01, 0.01, 0.01),
    "pelvis": (0.07, 0.1, 0.1, 0.01, 0.01, 0.01),
    "foot": (0.18, 0.05, 0.08, 0.01, 0.01, 0.01),
}
"""[rad], [m] of a segment by static cameras that last for a recording: its surface is another. A contour hardly tells
how a limb or a head turns about its long axis, z, and a foot about x."""

_CAMERA_RATIO = 0.6
"""Share of lines that measure something, over the median of the other cameras: a camera 24 cm off had 0.41, a good one
before a cluttered wall 0.85."""
_MIN_CAMERAS = 3  # needed to identify a wrong one


class RegionTracker:
    """Follows a body in the images of static cameras.

    Args:
        body: segments and joints, with people's usual limits where it has none; with equipment or without.
        surface: of its segments.
        stations: by name.
        settings: rate of learning and least confidence.
    """

    def __init__(
        self,
        body: BodyModel,
        surface: BodySurface,
        stations: Mapping[str, Station],
        settings: RegionSettings,
    ) -> None:
        body = with_usual_limits(body)
        self.body, self._settings = body, settings
        jointed = np.eye(len(body.segments), dtype=bool)
        jointed[tuple(body.joint_ends.T)] = jointed[tuple(body.joint_ends[:, ::-1].T)] = True
        self.views = {name: RegionModel(station, surface, jointed) for name, station in stations.items()}
        self._step = ArticulatedStep(body)
        self._loss = LossDetector(len(body.segments))
        self._support = SegmentSupport(body)
        self._camera_confidence: dict[str, float] = {}
        self._excluded = np.zeros(len(body.segments), bool)
        self._random = np.random.default_rng(_SEED)

    def initialise(
        self, images: Mapping[str, Image], placed: Array, unplaced: NDArray[np.bool_] | None = None
    ) -> Array:
        """Learn colours in the first images of a body placed by hand (S, 4, 4); returns its poses there, joints closed.

        Colours beside a contour that is some centimetres off are mixed, so they are learned anew as the body is found.
        It moves as one at first: feet are far off where the whole body is turned, and a leg may be taken for the other.
        Segments that were not placed (S,) are searched for, by the colours of their opposite or their parent. Those
        that the images do not support where they are found stay in the N-pose, unobserved, until the images do.
        """
        poses = self._step.close_joints(placed)
        missing = np.zeros(len(self.body.segments), bool) if unplaced is None else unplaced
        unknown = missing.copy()
        if unknown.any():
            self._excluded = unknown
            in_n_pose = poses = self._fit_start(images, poses, ~unknown)
            searched = self._search_unplaced(images, poses, unknown)
            self._excluded = np.zeros_like(unknown)
            loose = PredictedBody(searched, _LOOSE, float(_LOOSE[0]))
            poses, _, measured, contours = self._fit_poses(images, searched, loose)
            support = self._support.measure(measured.values(), *self._energies(images, contours))
            unknown &= ~(support >= _CONFIRMED)
            for parent, child in self.body.joint_ends.tolist():
                unknown[child] |= unknown[parent] & missing[child]
            poses = np.where(unknown[:, None, None], in_n_pose, poses)
            for view in self.views.values():
                view.reset_colours()
        self._support.unconfirmed = self._excluded = unknown
        poses = self._fit_start(images, self._step.close_joints(poses), ~unknown)
        self.update_colours(images, poses)
        return poses

    def _fit_start(self, images: Mapping[str, Image], placed: Array, learned: NDArray[np.bool_]) -> Array:
        """Poses (S, 4, 4) of a body that was placed by hand, by the colours of the learned segments (S,)."""
        firm = _MIXED**-0.5
        predicted = PredictedBody(placed, firm * START_SIGMAS, firm * _RIGID_RAD)
        poses = placed
        for turn in range(_START_ROUNDS):
            if turn == _START_ROUNDS // 2:
                predicted = PredictedBody(poses, firm * START_SIGMAS, firm * START_JOINT_RAD)
            for name, image in images.items():
                view = self.views[name]
                view.update_colours(image, view.find_contour(poses), 1.0 if turn == 0 else 0.5, learned)
            poses = self._fit_poses(images, poses, predicted)[0]
        return poses

    def _search_unplaced(self, images: Mapping[str, Image], poses: Array, unplaced: NDArray[np.bool_]) -> Array:
        """Poses (S, 4, 4) with the unplaced segments (S,) where the images have their neighbours' colours."""
        search = self._limb_search(images, ())
        unknown = unplaced.copy()
        for limb in search.limbs(unplaced):
            for view in self.views.values():
                view.copy_colours(colours_from(self.body, unknown))
            poses = search.find_limb(poses, limb)
            rows = [self.body.segment_index[self.body.tree_joints[row].child] for row in limb]
            unknown[rows] = False
            found = np.zeros(len(unknown), bool)
            found[rows] = True
            for name, image in images.items():
                self.views[name].update_colours(image, self.views[name].find_contour(poses), 1.0, found)
        return poses

    def update_colours(self, images: Mapping[str, Image], poses: Array) -> None:
        """Learn all colours in images of a body at poses (S, 4, 4)."""
        everything, poses = np.ones(len(self.body.segments), bool), self._step.close_joints(poses)
        for name, image in images.items():
            self.views[name].update_colours(image, self.views[name].find_contour(poses), 1.0, everything)

    def find_limbs(self, images: Mapping[str, Image], poses: Array, known: Collection[SegmentPose]) -> Array:
        """Poses (S, 4, 4) of a body with some known segments; the others are searched for in the images."""
        lost = np.ones(len(self.body.segments), bool)
        lost[[self.body.segment_index[each.segment] for each in known]] = False
        lost[[self.body.segment_index[segment] for segment in self.body.equipment_segments]] = False
        poses = self._step.close_joints(poses)
        for name, image in images.items():
            self.views[name].update_colours(image, self.views[name].find_contour(poses), 1.0, ~lost)
        found = self._search_unplaced(images, poses, lost)
        self.update_colours(images, found)
        return found

    def _limb_search(self, images: Mapping[str, Image], known: Collection[SegmentPose]) -> LimbSearch:
        """Search of limbs in images of one frame."""

        def energy(tried: Array) -> float:
            return float(self._energies(images, self._contours(images, tried))[0].sum())

        def refine(tried: Array) -> Array:
            return self._fit_poses(images, tried, PredictedBody(tried, _LOOSE, float(_LOOSE[0])), known)[0]

        return LimbSearch(self.body, energy, refine, self._random)

    def _contours(self, images: Iterable[str], poses: Array) -> dict[str, Contour]:
        """Contours of a body at poses (S, 4, 4), by station."""
        return {name: self.views[name].find_contour(poses) for name in images}

    def _energies(
        self, images: Mapping[str, Image], contours: Mapping[str, Contour]
    ) -> tuple[Array, NDArray[np.int64]]:
        """Pixels (S,) of all images that contours explain, and pixels (S,) of the segments."""
        energies, pixels = np.zeros(len(self.body.segments)), np.zeros(len(self.body.segments), np.int64)
        for name, image in images.items():
            explained, shown = self.views[name].energies(image, contours[name])
            energies, pixels = energies + explained, pixels + shown
        return energies, pixels

    def check_size(self, name: str, image: Image) -> None:
        """Refuse an image of another size than its camera's calibration.

        Raises:
            RecordingError: it is.
        """
        self.views[name].station.check_size(image)

    def measure(
        self, images: Mapping[str, Image], predicted: PredictedBody, known: Collection[SegmentPose] = ()
    ) -> StaticMeasurement:
        """Measure the body in images of one frame, by camera (H, W, 3), blue, green, red.

        Args:
            images: of the frame.
            predicted: the body's prediction.
            known: other measurements of some segments, which the body as a whole takes into account.
        """
        for name in images:
            self.views[name].copy_unknown_colours(
                other for other in self.views.values() if other is not self.views[name]
            )
        start = self._step.close_joints(predicted.world_T_segment)
        poses, before, measured, contours = self._fit_poses(images, start, predicted, known)
        energies, pixels = self._energies(images, contours)
        lost = self._loss.lost(energies, pixels)
        jumped = frozenset(np.flatnonzero(lost).tolist()) if self._loss.should_search else frozenset[int]()
        if jumped:
            found = self._limb_search(images, known).find(poses, lost)
            predicted = PredictedBody(found, _LOOSE, float(_LOOSE[0]))
            poses, before, measured, contours = self._fit_poses(images, found, predicted, known)
            energies, pixels = self._energies(images, contours)
            lost = self._loss.lost(energies, pixels)
        self._support.update(measured.values(), energies, pixels)
        false = self._support.false
        false[[self.body.segment_index[each.segment] for each in known]] = False
        self._excluded = self._support.unconfirmed
        self._judge_cameras(measured)
        misplaced = self.misplaced
        confidence = {name: regions.confidence for name, regions in measured.items()}
        usable = ~lost & ~self._excluded
        seen = {name: self._is_seen(regions) & usable & (name not in misplaced) for name, regions in measured.items()}
        by_any = np.any([*seen.values()], axis=0)
        for name, image in images.items():
            view = self.views[name]
            contour = view.propagate_contour(contours[name], poses)
            view.update_colours(image, contour, self._settings.learning_rate, seen[name] | (by_any & ~view.has_colours))
        evidence = {name: self._evidence(before, regions, seen[name]) for name, regions in measured.items()}
        unsupported = frozenset(np.flatnonzero(false).tolist())
        together = self._together(poses, measured, seen)
        return StaticMeasurement(
            evidence, together, poses, confidence, jumped, unsupported, misplaced, surface_variances(self.body)
        )

    def _judge_cameras(self, measured: Mapping[str, RegionEvidence]) -> None:
        """Smooth the share of each camera's lines that measure something."""
        for name, regions in measured.items():
            share = float(regions.lines.sum()) / max(int(regions.asked.sum()), 1)
            before = self._camera_confidence.get(name, share)
            self._camera_confidence[name] = before + _SUPPORT_RATE * (share - before)

    @property
    def misplaced(self) -> frozenset[str]:
        """Cameras whose images do not show the body where the others have it."""
        known = self._camera_confidence
        if len(known) < _MIN_CAMERAS:
            return frozenset()
        return frozenset(
            name
            for name, share in known.items()
            if share < _CAMERA_RATIO * np.median([other for each, other in known.items() if each != name])
        )

    def _fit_poses(
        self, images: Mapping[str, Image], start: Array, predicted: PredictedBody, known: Collection[SegmentPose] = ()
    ) -> tuple[Array, Array, dict[str, RegionEvidence], dict[str, Contour]]:
        """Poses (S, 4, 4) after all rounds, those before the last, the cameras' evidence at these, and contours."""
        poses = before = start
        measured: dict[str, RegionEvidence] = {}
        contours: dict[str, Contour] = {}
        misplaced = self.misplaced
        for turn in range(_ROUNDS):
            stride = max(1, _COARSE_STRIDE >> turn)
            for name in images:
                view = self.views[name]
                contours[name] = (
                    view.propagate_contour(contours[name], poses) if name in contours else view.find_contour(poses)
                )
            measured = {name: self.views[name].measure(image, contours[name], stride) for name, image in images.items()}
            used = [regions for name, regions in measured.items() if name not in misplaced]
            information = sum((regions.information for regions in used), np.zeros((len(poses), 6, 6)))
            vector = sum((regions.vector for regions in used), np.zeros((len(poses), 6)))
            before = poses
            information, vector = information / LINES_ALIKE, vector / LINES_ALIKE
            information[self._excluded], vector[self._excluded] = 0.0, 0.0
            for each in known:
                row = self.body.segment_index[each.segment]
                weight = np.linalg.inv(each.covariance)
                information[row] += weight
                vector[row] += weight @ log_se3(inverse(poses[row]) @ each.world_T_segment)
            poses = self._step.apply(poses, information, vector, predicted)
        return poses, before, measured, contours

    def _is_seen(self, regions: RegionEvidence) -> NDArray[np.bool_]:
        """Which segments (S,) have enough lines for a measurement."""
        seen: NDArray[np.bool_] = regions.lines >= _MIN_LINES
        seen &= regions.confidence >= self._settings.least_confidence
        return seen

    def _evidence(self, before: Array, regions: RegionEvidence, seen: NDArray[np.bool_]) -> list[SegmentPose]:
        """One camera's condensed poses, linearised at poses (S, 4, 4); what no line measures has a wide sigma."""
        rows = np.flatnonzero(seen)
        covariances = self._covariances(regions.information[rows])
        steps = (covariances @ (regions.vector[rows] / LINES_ALIKE)[..., None])[..., 0]
        poses = before[rows] @ exp_se3(steps)
        names = self.body.segments
        return [SegmentPose(names[row], *each) for row, *each in zip(rows.tolist(), poses, covariances, strict=True)]

    def _together(
        self, poses: Array, measured: Mapping[str, RegionEvidence], seen: Mapping[str, NDArray[np.bool_]]
    ) -> list[SegmentPose]:
        """All cameras' evidence combined, at the poses (S, 4, 4) of the body as a whole."""
        information = sum(
            (regions.information * seen[name][:, None, None] for name, regions in measured.items()),
            np.zeros((len(poses), 6, 6)),
        )
        rows = np.flatnonzero(np.any([seen[name] for name in measured], axis=0)) if measured else np.zeros(0, np.int64)
        covariances = self._covariances(information[rows])
        names = self.body.segments
        return [
            SegmentPose(names[row], poses[row], covariance)
            for row, covariance in zip(rows.tolist(), covariances, strict=True)
        ]

    def _covariances(self, information: Array) -> Array:
        """Covariances (N, 6, 6) of information (N, 6, 6) that counts every line by itself."""
        covariances: Array = np.linalg.inv(information / LINES_ALIKE + _VAGUE**-2.0 * np.eye(6))
        return covariances


def surface_variances(body: BodyModel) -> Array:
    """(S, 6) variances of the errors in segments' axes that a wrong surface leaves for a whole recording."""
    kinds = [SegmentName(segment).kind for segment in body.segments]
    return np.array([_SURFACE_SIGMAS.get(kind, _LIMB_SIGMAS) for kind in kinds]) ** 2


class SegmentSupport:
    """How well the images support each segment of a body.

    The support of a segment is the mean of two shares: of its lines that measure something, and of its pixels that have
    its colours rather than those beside it, less those that have not (B eq. 8).

    Args:
        body: segments and joints.

    Attributes:
        unconfirmed: (S,) segments that were not placed, and that the images have not confirmed since.
    """

    def __init__(self, body: BodyModel) -> None:
        self._body = body
        self.unconfirmed = np.zeros(len(body.segments), bool)
        self._smoothed = np.full(len(body.segments), np.nan)
        kinds = [SegmentName(segment).kind for segment in body.segments]
        self._least = np.where(np.isin(kinds, ["head", "hand", "foot"]), _MIN_END_SUPPORT, _MIN_SUPPORT)
        self._beside = body.named(body.equipment_segments)

    def update(self, measured: Collection[RegionEvidence], energies: Array, pixels: NDArray[np.int64]) -> None:
        """Add a frame."""
        support = self.measure(measured, energies, pixels)
        known = np.isfinite(support)
        fresh = known & np.isnan(self._smoothed)
        self._smoothed[fresh] = support[fresh]
        self._smoothed[known] += _SUPPORT_RATE * (support - self._smoothed)[known]
        self.unconfirmed = self.unconfirmed & ~(self._smoothed >= _CONFIRMED)

    def measure(self, measured: Collection[RegionEvidence], energies: Array, pixels: NDArray[np.int64]) -> Array:
        """Support (S,) in the images of a frame; NaN of segments that are hidden."""
        lines = sum((regions.lines for regions in measured), np.zeros(len(pixels), np.int64))
        asked = sum((regions.asked for regions in measured), np.zeros(len(pixels), np.int64))
        support = 0.5 * (lines / np.maximum(asked, 1) + energies / np.maximum(pixels, 1))
        support[(asked < _MIN_LINES) | (pixels < _MIN_PIXELS)] = np.nan
        return support

    @property
    def false(self) -> NDArray[np.bool_]:
        """(S,) segments that are not where the body has them, and their descendants."""
        false = ((self._smoothed < self._least) | self.unconfirmed) & ~self._beside
        for parent, child in self._body.joint_ends.tolist():
            false[child] |= false[parent] & ~self._beside[child]
        return false


_MIN_PIXELS = 60  # at half the resolution; of fewer no share can be computed
