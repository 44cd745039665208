"""Map extension by keyframes of registered body cameras: relative registration (A 4.1, second half).

The paper matches every newly registered image with the others, triangulates, and adjusts with the reference structure
fixed. Here keyframes of all cameras are processed in order of time.
"""

from collections import OrderedDict, deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.mapping.body_keyframe import BodyKeyframe, match_keyframes
from bodycam_ros.mapping.extendable_map import VIEWS, AddedLandmarks, ExtendableMap
from bodycam_ros.mapping.map_point import NO_SLOT, MapPoint, make_sighting, triangulate_points
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.pose_fit import reprojection_errors
from bodycam_ros.tracking.track_frame import NO_LANDMARK

NO_POINT = -1

_KEYFRAMES = 320  # of all cameras that new ones are matched with
_PARTNERS = 8  # keyframes that a new one is matched with
_MAX_SIGMA_M = 0.02  # of a keyframe's position: rays from uncertain positions make no points
_MIN_AXIS_COSINE = np.cos(np.radians(90.0))  # between optical axes of partners, A section 4.1
_MIN_BASELINE_M = 0.06  # between partners: less is no parallax at a metre
_MAX_ERROR_PX = 1.0  # largest reprojection error, A section 4.1
_MIN_ANGLE = np.radians(2.0)  # least angle between two rays, A section 4.1
_MIN_VIEWS = 3  # keyframes: two rays always nearly meet, the third reveals a wrong match
_MIN_DURATION_NS = 200_000_000  # between first and last view: what several cameras see at once may be moving
_OUTLIER_PX = 2.5  # reprojection error of a track from which on its landmark was an outlier
_MAX_STRIKES = 3  # images more in which a landmark was an outlier than inlier; then it is removed
_UNSEEN_NS = 20_000_000_000  # after which a landmark is removed
_UNSEEN_PER_INLIER_NS = 1_000_000_000  # by which an inlier lengthens that time
_RESTORED_INLIERS = 600  # credit of a landmark of an earlier run: ten minutes to be found again
_SWEEP_NS = 1_000_000_000
_LONGEST_STEP_NS = 10_000_000_000  # a longer step of a clock may be a clock that was set


class CameraTime:
    """Time that passes as the cameras' stamps do, and never goes back, whatever their clocks.

    Attributes:
        now_ns: since the first image [ns].
    """

    def __init__(self) -> None:
        self.now_ns = 0
        self._latest: dict[str, tuple[int, int]] = {}

    def advance(self, camera: str, stamp_ns: int) -> int:
        """The time of a camera's image [ns]; a camera that is new joins at the present."""
        before_ns, time_ns = self._latest.get(camera, (stamp_ns, self.now_ns))
        time_ns += min(max(0, stamp_ns - before_ns), _LONGEST_STEP_NS)
        self._latest[camera] = stamp_ns, time_ns
        self.now_ns = max(self.now_ns, time_ns)
        return time_ns


@dataclass(frozen=True)
class _Keyframe:
    """A keyframe, its time in that of all cameras, and the number (N,) of the point that each feature shows."""

    keyframe: BodyKeyframe
    time_ns: int
    points: NDArray[np.int64]


class LocalMapper:
    """Adds landmarks to a map, and removes those that turn out wrong or are not observed any more.

    Args:
        extendable_map: receives the landmarks in its slots; reference landmarks never move.
        cameras: models of the body cameras by name.
        keyframes, partners: how many keyframes are kept, and matched with each new one.

    Attributes:
        map: the map.
    """

    def __init__(
        self,
        extendable_map: ExtendableMap,
        cameras: Mapping[str, CameraModel],
        keyframes: int = _KEYFRAMES,
        partners: int = _PARTNERS,
    ) -> None:
        self.map = extendable_map
        self._cameras, self._max_keyframes, self._max_partners = cameras, keyframes, partners
        self._kept: deque[_Keyframe] = deque()
        self._points: dict[int, MapPoint] = {}
        self._next_point = 0
        self._point_in_slot: OrderedDict[int, int] = OrderedDict()  # the longest unobserved first
        self._next_id = [extendable_map.first_id + slot for slot in range(extendable_map.capacity)]
        self._free = list(range(extendable_map.capacity))[::-1]
        self._changed: dict[int, None] = {}
        self._time = CameraTime()
        self._swept_ns = 0

    @property
    def landmarks(self) -> int:
        """Number of added landmarks."""
        return len(self._point_in_slot)

    @property
    def keyframes(self) -> int:
        """Number of keyframes that new ones are matched with."""
        return len(self._kept)

    def added_points(self) -> list[MapPoint]:
        """The added landmarks, in the order of their slots."""
        return [self._points[number] for _, number in sorted(self._point_in_slot.items())]

    def clear(self) -> None:
        """Remove all added landmarks."""
        for number in list(self._point_in_slot.values()):
            self._remove(number)
        self._points.clear()
        self._kept.clear()

    def restore(self, added: AddedLandmarks) -> int:
        """Add landmarks of an earlier run in new slots; returns how many there was room for.

        They are the first to be replaced until they are observed again.
        """
        count = min(len(added.slots), self.map.capacity - self.landmarks)
        for row in range(count):
            saved = added.descriptors[row], added.views[row], added.sizes[row]
            position = added.points_world[row]
            point = MapPoint([], self._time.now_ns, position, inliers=_RESTORED_INLIERS, saved=saved)
            self._insert(self._add_point(point), point)
        return count

    def add_keyframe(self, keyframe: BodyKeyframe) -> None:
        """Extend the map by one more keyframe."""
        if keyframe.position_sigma > _MAX_SIGMA_M:
            return
        time_ns = self._time.advance(keyframe.camera, keyframe.stamp_ns)
        mine = _Keyframe(keyframe, time_ns, np.full(len(keyframe.bearings), NO_POINT))
        touched: dict[int, None] = {}
        # Added landmarks that are observed again.
        ids = keyframe.landmark_ids
        for feature in np.flatnonzero((ids >= self.map.first_id) & (ids != NO_LANDMARK)).tolist():
            number = self._number_of(int(ids[feature]))
            if number != NO_POINT:
                self._observe(number, mine, feature, touched)
        # New points: 2D-2D matches with keyframes whose axes are within 90 degrees (A 4.1).
        for partner in self._partners(keyframe):
            here, there = match_keyframes(keyframe, partner.keyframe)
            self._join(mine, here, partner, there, touched)
        # Error below 1 px and rays 2 degrees apart, or it is no point (A 4.1).
        self._triangulate(list(touched))
        self._keep(mine)

    def update(self, matches: LandmarkMatches) -> None:
        """Count inliers and outliers among the added landmarks of a registered image; remove frequent outliers."""
        now_ns = self._time.advance(matches.camera, matches.stamp_ns)
        pose = matches.world_T_camera
        added = np.flatnonzero(matches.landmark_ids >= self.map.first_id)
        if pose is not None and len(added):
            points_world = matches.points_world[added].astype(np.float64)
            errors = reprojection_errors(self._cameras[matches.camera], points_world, matches.pixels[added], pose)
            for landmark_id, is_outlier in zip(matches.landmark_ids[added].tolist(), errors > _OUTLIER_PX, strict=True):
                number = self._number_of(landmark_id)
                if number == NO_POINT:
                    continue
                point = self._points[number]
                self._point_in_slot.move_to_end(point.slot)
                point.seen_ns = now_ns
                point.inliers += not is_outlier
                point.strikes = point.strikes + 1 if is_outlier else max(-_MAX_STRIKES, point.strikes - 1)
                if point.strikes >= _MAX_STRIKES:
                    self._remove(number)

    def remove_unobserved(self) -> None:
        """Remove landmarks that were not observed for long; each inlier counts for one second more.

        Most added landmarks are never found again: without this they would fill the map to the last slot.
        """
        now_ns = self._time.now_ns
        if now_ns - self._swept_ns < _SWEEP_NS:
            return
        self._swept_ns = now_ns
        for number in list(self._point_in_slot.values()):
            point = self._points[number]
            if now_ns - point.seen_ns > _UNSEEN_NS + _UNSEEN_PER_INLIER_NS * point.inliers:
                self._remove(number)

    def take_changes(self) -> AddedLandmarks | None:
        """Apply the changes since the last call to the map, and return them for its copies."""
        if not self._changed:
            return None
        changes = AddedLandmarks.empty(np.array(list(self._changed)))
        self._changed.clear()
        for row, slot in enumerate(changes.slots.tolist()):
            if slot in self._point_in_slot:
                point = self._points[self._point_in_slot[slot]]
                changes.landmark_ids[row], changes.points_world[row] = point.landmark_id, point.position
                changes.descriptors[row], changes.views[row], changes.sizes[row] = point.descriptors(VIEWS)
        self.map.update(changes)
        return changes

    def _partners(self, keyframe: BodyKeyframe) -> list[_Keyframe]:
        """Kept keyframes that most likely show the same from another place (A 4.1)."""
        if not self._kept:
            return []
        poses = np.array([kept.keyframe.world_T_camera for kept in self._kept])
        cosines = poses[:, :3, 2] @ keyframe.world_T_camera[:3, 2]
        baselines = np.linalg.norm(poses[:, :3, 3] - keyframe.world_T_camera[:3, 3], axis=1)
        likely = np.flatnonzero((cosines > _MIN_AXIS_COSINE) & (baselines > _MIN_BASELINE_M))
        order = np.argsort(baselines[likely] - cosines[likely], kind="stable")[: self._max_partners]
        return [self._kept[row] for row in likely[order].tolist()]

    def _add_point(self, point: MapPoint) -> int:
        self._points[self._next_point] = point
        self._next_point += 1
        return self._next_point - 1

    def _number_of(self, landmark_id: int) -> int:
        """The point of a landmark; ``NO_POINT`` if it was removed."""
        number = self._point_in_slot.get((landmark_id - self.map.first_id) % self.map.capacity, NO_POINT)
        return number if number != NO_POINT and self._points[number].landmark_id == landmark_id else NO_POINT

    def _join(
        self,
        mine: _Keyframe,
        here: NDArray[np.int64],
        partner: _Keyframe,
        there: NDArray[np.int64],
        touched: dict[int, None],
    ) -> None:
        """Let matched features show one point: that of either, or a new one."""
        for feature, other in zip(here.tolist(), there.tolist(), strict=True):
            own, its = int(mine.points[feature]), int(partner.points[other])
            its = its if its in self._points else NO_POINT
            if own == NO_POINT and its == NO_POINT:
                own = self._add_point(MapPoint([], mine.time_ns))
                self._observe(own, partner, other, touched)
                self._observe(own, mine, feature, touched)
            elif own == NO_POINT:
                self._observe(its, mine, feature, touched)
            elif its == NO_POINT:
                self._observe(own, partner, other, touched)

    def _observe(self, number: int, kept: _Keyframe, feature: int, touched: dict[int, None]) -> None:
        """Add a feature's sighting of a point."""
        point = self._points[number]
        kept.points[feature] = number
        if point.slot != NO_SLOT:
            self._point_in_slot.move_to_end(point.slot)
        if point.add(make_sighting(kept.keyframe, feature, kept.time_ns)):
            touched[number] = None

    def _triangulate(self, numbers: list[int]) -> None:
        """Triangulate points that have new sightings; remove those that their rays contradict."""
        if not numbers:
            return
        found = triangulate_points([self._points[number] for number in numbers])
        is_good = found.errors_px.max(axis=1) <= _MAX_ERROR_PX
        is_wide = found.angles >= _MIN_ANGLE
        for number, position, good, wide in zip(numbers, found.points, is_good, is_wide, strict=True):
            point = self._points[number]
            if not good:
                self._remove(number)
                continue
            point.position = position
            if point.slot != NO_SLOT:
                self._changed[point.slot] = None
            elif wide and len(point.sightings) >= _MIN_VIEWS:
                times_ns = [sighting.time_ns for sighting in point.sightings]
                if max(times_ns) - min(times_ns) >= _MIN_DURATION_NS:
                    self._insert(number, point)

    def _insert(self, number: int, point: MapPoint) -> None:
        """Make a point a landmark; if no slot is free it replaces the one that was unobserved for longest.

        If all were observed since, the point is not inserted now.
        """
        if not self._free:
            oldest = next(iter(self._point_in_slot.values()))
            if self._points[oldest].seen_ns >= point.seen_ns:
                return
            self._remove(oldest)
        point.slot = self._free.pop()
        # Every landmark of a slot has an id of its own, so that it is not mistaken for one before it.
        point.landmark_id = self._next_id[point.slot]
        self._next_id[point.slot] += self.map.capacity
        self._point_in_slot[point.slot] = number
        self._changed[point.slot] = None

    def _remove(self, number: int) -> None:
        point = self._points.pop(number)
        if point.slot != NO_SLOT:
            del self._point_in_slot[point.slot]
            self._free.append(point.slot)
            self._changed[point.slot] = None

    def _keep(self, mine: _Keyframe) -> None:
        """Match later keyframes with this one, and no more with the oldest; drop points that only that one suggests."""
        if len(self._kept) == self._max_keyframes:
            for number in self._kept.popleft().points.tolist():
                point = self._points.get(number)
                if point is not None and point.slot == NO_SLOT:
                    del self._points[number]
        self._kept.append(mine)
