"""A body seen from outside: static cameras, the regions that its surface splits their images into (B 2.3-2.4).

All stations look at the same body, so a few rounds of lines and steps move it as one, joints closed, from where it is
expected; the last round's lines are what the stations have to say. They say it of each segment by itself, as a worn
camera does, so that the solver weighs them like any other camera.
"""

from collections.abc import Collection, Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.estimation.looking_on import SeenBody
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3
from bodycam_ros.static_cameras.articulated_step import ArticulatedStep, ExpectedBody
from bodycam_ros.static_cameras.body_shape import BodySurface
from bodycam_ros.static_cameras.limb_search import LimbSearch, colours_from, with_usual_limits
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.station import Contour, Image, Presence, SegmentRegions, Station, StationView

_LOOSE = np.repeat([0.3, 0.05], 3)
"""[rad], [m] how far a pose that was tried may be from where the images have it."""

_SEED = 1
"""Of the poses that are tried of lost limbs: a replay gives the same result each time."""

_VAGUE = 1.0
"""[rad], [m] sigma of what no line tells, such as a limb's long axis: open, but with an inverse."""

_MIXED = 2.5  # times as many lines count as one while colours are mixed
_AS_ONE_RAD = 0.01  # of joints while a body that was placed by hand moves as one


class RegionTracker:
    """Follows a body in the images of stations.

    Args:
        body: segments and joints, held to people's usual limits where it has none; with equipment or without.
        surface: of its segments.
        stations: by name.
        settings: lines, colours, trust.
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
        self.views = {name: StationView(station, surface, settings, jointed) for name, station in stations.items()}
        self._step = ArticulatedStep(body)
        self._presence = Presence(len(body.segments))
        self._random = np.random.default_rng(_SEED)

    def begin(self, images: Mapping[str, Image], placed: Array) -> Array:
        """Learn colours in first images of a body that was placed by hand (S, 4, 4); where it is then, joints closed.

        Colours beside a contour that is some centimetres off are mixed, so they are learned anew as the body is found.
        It moves as one at first: feet are far off where the whole body is turned, and a leg may be taken for the other.
        """
        of = self._settings
        placed = self._step.closed(placed)
        firm = _MIXED**-0.5
        joint_sigma, sigmas = firm * of.start_joint_sigma, firm * of.start_sigmas
        expected = ExpectedBody(placed, sigmas, firm * _AS_ONE_RAD)
        poses = placed
        everything = np.ones(len(self.body.segments), bool)
        for turn in range(of.start_rounds):
            if turn == of.start_rounds // 2:
                expected = ExpectedBody(poses, sigmas, joint_sigma)
            for name, image in images.items():
                view = self.views[name]
                view.learn(image, view.contour(poses), 1.0 if turn == 0 else 0.5, everything)
            poses = self._found(images, poses, expected)[0]
        self.learn(images, poses)
        return poses

    def learn(self, images: Mapping[str, Image], poses: Array) -> None:
        """Learn all colours in images of a body at poses (S, 4, 4)."""
        everything, poses = np.ones(len(self.body.segments), bool), self._step.closed(poses)
        for name, image in images.items():
            self.views[name].learn(image, self.views[name].contour(poses), 1.0, everything)

    def find_limbs(self, images: Mapping[str, Image], poses: Array, known: Collection[SegmentPose]) -> Array:
        """Poses (S, 4, 4) of a body of which others know some segments, and where the images have the rest of it."""
        lost = np.ones(len(self.body.segments), bool)
        lost[[self.body.segment_index[each.segment] for each in known]] = False
        lost[[self.body.segment_index[segment] for segment in self.body.equipment_segments]] = False
        poses = self._step.closed(poses)
        for name, image in images.items():
            self.views[name].learn(image, self.views[name].contour(poses), 1.0, ~lost)
            self.views[name].adopt(colours_from(self.body, lost))

        found = self._limb_search(images, known).find(poses, lost)
        self.learn(images, found)
        return found

    def _limb_search(self, images: Mapping[str, Image], known: Collection[SegmentPose]) -> LimbSearch:
        """Looks for limbs in images of one instant."""

        def energy(tried: Array) -> float:
            return float(self._energies(images, self._contours(images, tried))[0].sum())

        def refine(tried: Array) -> Array:
            return self._found(images, tried, ExpectedBody(tried, _LOOSE, float(_LOOSE[0])), known)[0]

        return LimbSearch(self.body, energy, refine, self._random)

    def _contours(self, images: Iterable[str], poses: Array) -> dict[str, Contour]:
        """Contours of a body at poses (S, 4, 4), by station."""
        return {name: self.views[name].contour(poses) for name in images}

    def _energies(
        self, images: Mapping[str, Image], contours: Mapping[str, Contour]
    ) -> tuple[Array, NDArray[np.int64]]:
        """How many pixels (S,) of all images contours explain, and how many (S,) the segments have."""
        energies, pixels = np.zeros(len(self.body.segments)), np.zeros(len(self.body.segments), np.int64)
        for name, image in images.items():
            explained, shown = self.views[name].energies(image, contours[name])
            energies, pixels = energies + explained, pixels + shown
        return energies, pixels

    def check_size(self, name: str, image: Image) -> None:
        """Refuse an image of another size than its station's lens is for.

        Raises:
            RecordingError: it is.
        """
        self.views[name].station.check_size(image)

    def look(
        self, images: Mapping[str, Image], expected: ExpectedBody, known: Collection[SegmentPose] = ()
    ) -> SeenBody:
        """Where the body is in images of one instant, by station (H, W, 3), blue, green, red.

        Args:
            images: of the instant.
            expected: where it should be.
            known: what others say of some segments; the body as a whole obeys it.
        """
        for name in images:
            self.views[name].borrow(other for other in self.views.values() if other is not self.views[name])
        start = self._step.closed(expected.world_T_segment)
        poses, before, said, contours = self._found(images, start, expected, known)
        lost = self._presence.lost(*self._energies(images, contours))
        jumped = frozenset(np.flatnonzero(lost).tolist()) if self._presence.should_search else frozenset[int]()
        if jumped:
            found = self._limb_search(images, known).find(poses, lost)
            expected = ExpectedBody(found, _LOOSE, float(_LOOSE[0]))
            poses, before, said, contours = self._found(images, found, expected, known)
            lost = self._presence.lost(*self._energies(images, contours))
        confidence = {name: regions.confidence for name, regions in said.items()}
        seen = {name: self._is_seen(regions) & ~lost for name, regions in said.items()}
        by_any = np.any([*seen.values()], axis=0)
        for name, image in images.items():
            view = self.views[name]
            contour = view.carried(contours[name], poses)
            view.learn(image, contour, self._settings.learning_rate, seen[name] | (by_any & ~view.knows))
        evidence = {name: self._evidence(before, regions, seen[name]) for name, regions in said.items()}
        return SeenBody(evidence, self._together(poses, said, seen), poses, confidence, jumped)

    def _found(
        self, images: Mapping[str, Image], start: Array, expected: ExpectedBody, known: Collection[SegmentPose] = ()
    ) -> tuple[Array, Array, dict[str, SegmentRegions], dict[str, Contour]]:
        """Poses (S, 4, 4) after all rounds, those before the last, what the stations said of these, and where."""
        poses = before = start
        said: dict[str, SegmentRegions] = {}
        contours: dict[str, Contour] = {}
        for turn in range(self._settings.rounds):
            stride = max(1, self._settings.coarse_stride >> turn)
            for name in images:
                view = self.views[name]
                contours[name] = view.carried(contours[name], poses) if name in contours else view.contour(poses)
            said = {name: self.views[name].look(image, contours[name], stride) for name, image in images.items()}
            information = sum((regions.information for regions in said.values()), np.zeros((len(poses), 6, 6)))
            vector = sum((regions.vector for regions in said.values()), np.zeros((len(poses), 6)))
            before = poses
            information, vector = information / self._settings.lines_alike, vector / self._settings.lines_alike
            for each in known:
                row = self.body.segment_index[each.segment]
                weight = np.linalg.inv(each.covariance)
                information[row] += weight
                vector[row] += weight @ log_se3(inverse(poses[row]) @ each.world_T_segment)
            poses = self._step.moved(poses, information, vector, expected)
        return poses, before, said, contours

    def _is_seen(self, regions: SegmentRegions) -> NDArray[np.bool_]:
        """Which segments (S,) are seen well enough to say something."""
        of = self._settings
        seen: NDArray[np.bool_] = (regions.lines >= of.least_lines) & (regions.confidence >= of.least_confidence)
        return seen

    def _evidence(self, before: Array, regions: SegmentRegions, seen: NDArray[np.bool_]) -> list[SegmentPose]:
        """One station's condensed poses, linearised at poses (S, 4, 4): what no line tells stays there, vague."""
        rows = np.flatnonzero(seen)
        covariances = self._covariances(regions.information[rows])
        steps = (covariances @ (regions.vector[rows] / self._settings.lines_alike)[..., None])[..., 0]
        poses = before[rows] @ exp_se3(steps)
        names = self.body.segments
        return [SegmentPose(names[row], *each) for row, *each in zip(rows.tolist(), poses, covariances, strict=True)]

    def _together(
        self, poses: Array, said: Mapping[str, SegmentRegions], seen: Mapping[str, NDArray[np.bool_]]
    ) -> list[SegmentPose]:
        """All stations' evidence in one, at the poses (S, 4, 4) of the body as a whole."""
        information = sum(
            (regions.information * seen[name][:, None, None] for name, regions in said.items()),
            np.zeros((len(poses), 6, 6)),
        )
        rows = np.flatnonzero(np.any([seen[name] for name in said], axis=0)) if said else np.zeros(0, np.int64)
        covariances = self._covariances(information[rows])
        names = self.body.segments
        return [
            SegmentPose(names[row], poses[row], covariance)
            for row, covariance in zip(rows.tolist(), covariances, strict=True)
        ]

    def _covariances(self, information: Array) -> Array:
        """Covariances (N, 6, 6) of information (N, 6, 6) that counts every line by itself."""
        covariances: Array = np.linalg.inv(information / self._settings.lines_alike + _VAGUE**-2.0 * np.eye(6))
        return covariances
