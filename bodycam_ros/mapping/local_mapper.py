"""Map extension by keyframes of registered body cameras: relative registration (A 4.1, second half).

The paper matches every newly registered image with the others, triangulates, and adjusts with the reference structure
fixed. Here keyframes of all cameras are processed in order of time.
"""

from collections import OrderedDict, deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.mapping.body_keyframe import BodyKeyframe
from bodycam_ros.mapping.epipolar_matching import match_posed
from bodycam_ros.mapping.extendable_map import VIEWS, AddedLandmarks, ExtendableMap
from bodycam_ros.mapping.map_point import NO_SLOT, REMOVED, MapPoint, make_sighting, triangulate_points
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.pose_fit import reprojection_errors
from bodycam_ros.tracking.track_frame import NO_LANDMARK

_KEYFRAMES = 320  # of all cameras that new ones are matched with
_PARTNERS = 8  # keyframes that a new one is matched with
_MAX_SIGMA_M = 0.02  # of a keyframe's position: rays from uncertain positions make no points
_MIN_AXIS_COSINE = np.cos(np.radians(90.0))  # between optical axes of partners, A section 4.1
_MIN_BASELINE_M = 0.06  # between partners: less is no parallax at a metre
_EPIPOLAR_PX = 2.0  # of a match beside its epipolar line: features and poses err
_MAX_RATIO = 0.85  # best to second best distance along the epipolar line (Lowe 2004)
_MAX_DISTANCE = 230.0  # between RootSIFT vectors of length 512
_MAX_ERROR_PX = 1.0  # largest reprojection error, A section 4.1
_MIN_ANGLE = np.radians(2.0)  # least angle between two rays, A section 4.1
_MIN_VIEWS = 3  # keyframes: two rays always nearly meet, the third reveals a wrong match
_MIN_DURATION_NS = 200_000_000  # between first and last view: what several cameras see at once may be moving
_OUTLIER_PX = 2.5  # reprojection error of a track from which on its landmark was an outlier
_MAX_STRIKES = 3  # images more in which a landmark was an outlier than inlier; then it is removed


@dataclass(frozen=True)
class _Keyframe:
    """A keyframe, and the point (N,) that each feature shows."""

    keyframe: BodyKeyframe
    points: list[MapPoint | None]

    def point(self, feature: int) -> MapPoint | None:
        """The point that a feature shows, if it was not removed."""
        point = self.points[feature]
        return None if point is None or point.slot == REMOVED else point


class LocalMapper:
    """Adds landmarks to a map, and removes those that turn out wrong, or that others need the room of.

    Args:
        extendable_map: receives the landmarks in its slots; reference landmarks never move.
        cameras: models of the body cameras by name.
        partners: keyframes that each new one is matched with.

    Attributes:
        map: the map.
    """

    def __init__(
        self, extendable_map: ExtendableMap, cameras: Mapping[str, CameraModel], partners: int = _PARTNERS
    ) -> None:
        self.map = extendable_map
        self._cameras, self._max_partners = cameras, partners
        self._kept: deque[_Keyframe] = deque(maxlen=_KEYFRAMES)
        self._landmarks: OrderedDict[int, MapPoint] = OrderedDict()  # by slot, the longest unobserved first
        self._next_id = [extendable_map.first_id + slot for slot in range(extendable_map.capacity)]
        self._free = list(range(extendable_map.capacity))[::-1]
        self._changed: dict[int, None] = {}

    @property
    def landmarks(self) -> int:
        """Number of added landmarks."""
        return len(self._landmarks)

    @property
    def keyframes(self) -> int:
        """Number of keyframes that new ones are matched with."""
        return len(self._kept)

    def added_points(self) -> list[MapPoint]:
        """The added landmarks, in the order of their slots."""
        return [point for _, point in sorted(self._landmarks.items())]

    def clear(self) -> None:
        """Remove all added landmarks."""
        for point in list(self._landmarks.values()):
            self._remove(point)
        self._kept.clear()

    def restore(self, added: AddedLandmarks) -> int:
        """Add landmarks of an earlier run in new slots; returns how many there was room for.

        They are the first to be replaced until they are observed again.
        """
        count = min(len(added.slots), len(self._free))
        for row in range(count):
            saved = added.descriptors[row], added.views[row], added.sizes[row]
            self._insert(MapPoint(position=added.points_world[row], saved=saved))
        return count

    def add_keyframe(self, keyframe: BodyKeyframe) -> None:
        """Extend the map by one more keyframe."""
        if keyframe.position_sigma > _MAX_SIGMA_M:
            return
        ids = keyframe.landmark_ids
        mine = _Keyframe(keyframe, [None] * len(ids))
        touched: dict[MapPoint, None] = {}
        # Added landmarks that are observed again.
        for feature in np.flatnonzero((ids >= self.map.first_id) & (ids != NO_LANDMARK)).tolist():
            if (point := self._landmark(int(ids[feature]))) is not None:
                self._observe(point, mine, feature, touched)
        # New points: 2D-2D matches with keyframes whose axes are within 90 degrees (A 4.1).
        for partner in self._partners(keyframe):
            images = keyframe, partner.keyframe
            unknown = np.flatnonzero(ids == NO_LANDMARK), np.flatnonzero(images[1].landmark_ids == NO_LANDMARK)
            for here, there in match_posed(images, unknown, _EPIPOLAR_PX, _MAX_RATIO, _MAX_DISTANCE).tolist():
                own, its = mine.point(here), partner.point(there)
                point = own or its or MapPoint()
                if its is None:
                    self._observe(point, partner, there, touched)
                if own is None:
                    self._observe(point, mine, here, touched)
        # Error below 1 px and rays 2 degrees apart, or it is no point (A 4.1).
        self._triangulate(list(touched))
        self._kept.append(mine)

    def update(self, matches: LandmarkMatches) -> None:
        """Count inliers and outliers among the added landmarks of a registered image; remove frequent outliers."""
        pose = matches.world_T_camera
        added = np.flatnonzero(matches.landmark_ids >= self.map.first_id)
        if pose is None or not len(added):
            return
        points_world = matches.points_world[added].astype(np.float64)
        errors = reprojection_errors(self._cameras[matches.camera], points_world, matches.pixels[added], pose)
        for landmark_id, is_outlier in zip(matches.landmark_ids[added].tolist(), errors > _OUTLIER_PX, strict=True):
            if (point := self._landmark(landmark_id)) is not None:
                self._landmarks.move_to_end(point.slot)
                point.strikes = point.strikes + 1 if is_outlier else max(-_MAX_STRIKES, point.strikes - 1)
                if point.strikes >= _MAX_STRIKES:
                    self._remove(point)

    def take_changes(self) -> AddedLandmarks | None:
        """Apply the changes since the last call to the map, and return them for its copies."""
        if not self._changed:
            return None
        changes = AddedLandmarks.empty(np.array(list(self._changed)))
        self._changed.clear()
        for row, slot in enumerate(changes.slots.tolist()):
            if (point := self._landmarks.get(slot)) is not None:
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

    def _landmark(self, landmark_id: int) -> MapPoint | None:
        """The point of a landmark; None if it was removed."""
        point = self._landmarks.get((landmark_id - self.map.first_id) % self.map.capacity)
        return None if point is None or point.landmark_id != landmark_id else point

    def _observe(self, point: MapPoint, kept: _Keyframe, feature: int, touched: dict[MapPoint, None]) -> None:
        """Add a feature's sighting of a point."""
        kept.points[feature] = point
        if point.slot != NO_SLOT:
            self._landmarks.move_to_end(point.slot)
        if point.add(make_sighting(kept.keyframe, feature)):
            touched[point] = None

    def _triangulate(self, points: list[MapPoint]) -> None:
        """Triangulate points that have new sightings; remove those that their rays contradict."""
        if not points:
            return
        found = triangulate_points(points)
        is_good = found.errors_px.max(axis=1) <= _MAX_ERROR_PX
        is_wide = found.angles >= _MIN_ANGLE
        for point, position, good, wide in zip(points, found.points, is_good, is_wide, strict=True):
            if not good:
                self._remove(point)
                continue
            point.position = position
            if point.slot in self._landmarks:
                self._changed[point.slot] = None
            elif wide and len(point.sightings) >= _MIN_VIEWS and point.slot == NO_SLOT:
                stamps_ns = [sighting.stamp_ns for sighting in point.sightings]
                if max(stamps_ns) - min(stamps_ns) >= _MIN_DURATION_NS:
                    self._insert(point)

    def _insert(self, point: MapPoint) -> None:
        """Make a point a landmark; if no slot is free it replaces the one that was unobserved for longest."""
        if not self._free:
            self._remove(next(iter(self._landmarks.values())))
        point.slot = self._free.pop()
        # Every landmark of a slot has an id of its own, so that it is not mistaken for one before it.
        point.landmark_id = self._next_id[point.slot]
        self._next_id[point.slot] += self.map.capacity
        self._landmarks[point.slot] = point
        self._changed[point.slot] = None

    def _remove(self, point: MapPoint) -> None:
        if point.slot in self._landmarks:
            del self._landmarks[point.slot]
            self._free.append(point.slot)
            self._changed[point.slot] = None
        point.slot = REMOVED
