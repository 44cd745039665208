"""Growth of the map by what registered worn cameras see: relative registration (A 4.1, second half).

The paper matches every newly registered image with the others, triangulates, and adjusts with the reference structure
fixed. Here it is done for keyframes, as they come, of all cameras in order of time.
"""

from collections import OrderedDict, deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.mapping.growing_map import LOOKS, NO_SLOT, GrowingMap, GrownLandmarks, GrownPoint, rays_of, sighting
from bodycam_ros.mapping.growth_settings import GrowthSettings
from bodycam_ros.mapping.worn_keyframe import WornKeyframe, match_keyframes, triangulate
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.pose_fit import reprojection_errors
from bodycam_ros.tracking.keypoints import DESCRIPTOR_LENGTH
from bodycam_ros.tracking.track_frame import NO_LANDMARK


@dataclass(frozen=True)
class KeptKeyframe:
    """A keyframe and what it turned out to show.

    Attributes:
        keyframe: what it saw.
        at_ns: when, by the time that all cameras share [ns].
        points: (N,) number of the point that each of its features shows, negative if none.
    """

    keyframe: WornKeyframe
    at_ns: int
    points: NDArray[np.int64]


class KeptKeyframes:
    """The latest keyframes of all cameras.

    Args:
        settings: how many, and who is matched with whom.
    """

    def __init__(self, settings: GrowthSettings) -> None:
        self._settings = settings
        self._kept: deque[KeptKeyframe] = deque()

    def __len__(self) -> int:
        return len(self._kept)

    def clear(self) -> None:
        """None is left."""
        self._kept.clear()

    def add(self, kept: KeptKeyframe) -> KeptKeyframe | None:
        """One more; the oldest, if it has to go for it."""
        gone = self._kept.popleft() if len(self._kept) == self._settings.keyframes else None
        self._kept.append(kept)
        return gone

    def partners(self, keyframe: WornKeyframe) -> list[KeptKeyframe]:
        """Those that most likely see the same as another, from another place (A 4.1)."""
        if not self._kept:
            return []
        poses = np.array([kept.keyframe.world_T_camera for kept in self._kept])
        cosines = poses[:, :3, 2] @ keyframe.world_T_camera[:3, 2]
        baselines = np.linalg.norm(poses[:, :3, 3] - keyframe.world_T_camera[:3, 3], axis=1)
        fit = (cosines > np.cos(np.radians(self._settings.max_axis_angle))) & (baselines > self._settings.min_baseline)
        likely = np.flatnonzero(fit)
        order = np.argsort(baselines[likely] - cosines[likely], kind="stable")[: self._settings.partners]
        return [self._kept[row] for row in likely[order].tolist()]


_LONGEST_NS: Final = 10_000_000_000
"""What seems to be a longer pause may be a clock that was set: so much of it counts."""


class SteadyTime:
    """Time that passes as the cameras' stamps do, and never goes back.

    Attributes:
        now_ns: since the first image [ns].
    """

    def __init__(self) -> None:
        self.now_ns = 0
        self._latest_ns: dict[str, int] = {}
        self._passed_ns: dict[str, int] = {}

    def at(self, camera: str, stamp_ns: int) -> int:
        """The time of a camera's image [ns]; a camera that is new joins at the present."""
        before_ns = self._latest_ns.get(camera)
        if before_ns is None:
            self._passed_ns[camera] = self.now_ns
        else:
            self._passed_ns[camera] += min(max(0, stamp_ns - before_ns), _LONGEST_NS)
        self._latest_ns[camera] = stamp_ns
        self.now_ns = max(self.now_ns, self._passed_ns[camera])
        return self._passed_ns[camera]


_WRONG_PX = 2.5
"""A landmark this far from where its track is was wrong in that image."""

_SWEEP_NS = 1_000_000_000

_WAIT_PER_IMAGE_S = 1.0
"""So much longer a landmark stays unseen for every image that it was right in."""

_RIGHT_BEFORE = 600
"""Images that a landmark of an earlier run counts as having been right in: ten minutes to be found again."""

NO_POINT = -1


class MapGrowth:
    """Adds landmarks to a map, and takes away those that turn out wrong or are not seen any more.

    Args:
        growing_map: the map, in whose slots the landmarks go; reference landmarks never move.
        cameras: models of the worn cameras by name.
        settings: criteria and bounds.
    """

    def __init__(
        self, growing_map: GrowingMap, cameras: Mapping[str, CameraModel], settings: GrowthSettings | None = None
    ) -> None:
        self.map = growing_map
        self.settings = settings or GrowthSettings()
        self._cameras = cameras
        self._kept = KeptKeyframes(self.settings)
        self._points: dict[int, GrownPoint] = {}
        self._next_point = 0
        self._point_in_slot: OrderedDict[int, int] = OrderedDict()  # the longest unseen first
        self._next_id = [growing_map.first_id + slot for slot in range(growing_map.capacity)]
        self._time = SteadyTime()
        self._swept_ns = 0
        self._never_used = 0
        self._free: list[int] = []
        self._changed: dict[int, None] = {}

    @property
    def landmarks(self) -> int:
        """Landmarks that have grown and are there."""
        return len(self._point_in_slot)

    def grown_points(self) -> list[GrownPoint]:
        """Those that are landmarks, in the order of their slots."""
        return [self._points[number] for _, number in sorted(self._point_in_slot.items())]

    @property
    def keyframes(self) -> int:
        """Keyframes that later ones are matched with."""
        return len(self._kept)

    def forget(self) -> None:
        """All that has grown goes."""
        for number in list(self._point_in_slot.values()):
            self._drop(number)
        self._points.clear()
        self._kept.clear()

    def remember(self, grown: GrownLandmarks) -> int:
        """Landmarks of an earlier run are there again, as they were; how many of them there is room for.

        Their slots and ids are new ones. If room is needed they are the first to go, until they are seen again.
        """
        count = min(len(grown.slots), self.map.capacity - self.landmarks)
        for row in range(count):
            looks = grown.descriptors[row], grown.views[row], grown.sizes[row]
            point = GrownPoint([], self._time.now_ns, grown.points_world[row], right=_RIGHT_BEFORE, kept_looks=looks)
            self._points[self._next_point] = point
            self._settle(self._next_point, point)
            self._next_point += 1
        return count

    def add(self, keyframe: WornKeyframe) -> None:
        """Grow by one more keyframe."""
        if keyframe.position_sigma > self.settings.max_sigma:
            return
        mine = KeptKeyframe(
            keyframe, self._time.at(keyframe.camera, keyframe.stamp_ns), np.full(len(keyframe.bearings), NO_POINT)
        )
        touched: dict[int, None] = {}
        # Landmarks that have grown before are seen again.
        self._see_known(mine, touched)
        # New points: 2D-2D matches with keyframes whose axes are within 90 degrees (A 4.1).
        unnamed = np.flatnonzero(keyframe.landmark_ids == NO_LANDMARK)
        for partner in self._kept.partners(keyframe):
            unnamed_there = np.flatnonzero(partner.keyframe.landmark_ids == NO_LANDMARK)
            here, there = match_keyframes(keyframe, partner.keyframe, unnamed, unnamed_there, self.settings)
            self._join(mine, here, partner, there, touched)
        # Error below 1 px and rays 2 degrees apart, or it is no point (A 4.1).
        self._triangulate(list(touched))
        self._keep(mine)

    def hear(self, matches: LandmarkMatches) -> None:
        """What a camera made of landmarks that have grown: who is wrong too often goes."""
        now_ns = self._time.at(matches.camera, matches.stamp_ns)
        pose = matches.world_T_camera
        grown = np.flatnonzero(matches.landmark_ids >= self.map.first_id)
        if pose is None or not len(grown):
            return
        points_world = matches.points_world[grown].astype(np.float64)
        errors = reprojection_errors(self._cameras[matches.camera], points_world, matches.pixels[grown], pose)
        for landmark_id, wrong in zip(matches.landmark_ids[grown].tolist(), errors > _WRONG_PX, strict=True):
            number = self._number_of(landmark_id)
            if number == NO_POINT:
                continue
            point = self._points[number]
            self._point_in_slot.move_to_end(point.slot)
            point.seen_ns = now_ns
            point.strikes = point.strikes + 1 if wrong else max(-self.settings.max_strikes, point.strikes - 1)
            point.right += not wrong
            if point.strikes >= self.settings.max_strikes:
                self._drop(number)

    def forget_unseen(self) -> None:
        """Take away what nobody has found for long; what was found often before is waited for the longer.

        Most of what grows is never found again: without this the map would fill up with it, to the last slot.
        """
        now_ns = self._time.now_ns
        if now_ns - self._swept_ns < _SWEEP_NS:
            return
        self._swept_ns = now_ns
        for number in list(self._point_in_slot.values()):
            point = self._points[number]
            if now_ns - point.seen_ns > 1e9 * (self.settings.forget_after + _WAIT_PER_IMAGE_S * point.right):
                self._drop(number)

    def take_changes(self) -> GrownLandmarks | None:
        """What has changed since the last call, for the copies of the map; it is in ours already."""
        if not self._changed:
            return None
        slots = list(self._changed)
        self._changed.clear()
        ids = np.full(len(slots), NO_LANDMARK, np.uint32)
        positions = np.zeros((len(slots), 3))
        descriptors = np.zeros((len(slots), LOOKS, DESCRIPTOR_LENGTH), np.uint8)
        views, sizes = np.zeros((len(slots), LOOKS, 3), np.float32), np.zeros((len(slots), LOOKS), np.float32)
        for row, slot in enumerate(slots):
            if slot in self._point_in_slot:
                point = self._points[self._point_in_slot[slot]]
                ids[row], positions[row] = point.landmark_id, point.position
                descriptors[row], views[row], sizes[row] = point.looks(LOOKS)
        changes = GrownLandmarks(np.array(slots), ids, positions, descriptors, views, sizes)
        self.map.take(changes)
        return changes

    def _see_known(self, mine: KeptKeyframe, touched: dict[int, None]) -> None:
        ids = mine.keyframe.landmark_ids
        for feature in np.flatnonzero((ids >= self.map.first_id) & (ids != NO_LANDMARK)).tolist():
            number = self._number_of(int(ids[feature]))
            if number != NO_POINT:
                self._see(number, mine, feature, touched)

    def _number_of(self, landmark_id: int) -> int:
        """The point that is a landmark; ``NO_POINT`` if it has gone."""
        number = self._point_in_slot.get((landmark_id - self.map.first_id) % self.map.capacity, NO_POINT)
        return number if number != NO_POINT and self._points[number].landmark_id == landmark_id else NO_POINT

    def _join(
        self,
        mine: KeptKeyframe,
        here: NDArray[np.int64],
        partner: KeptKeyframe,
        there: NDArray[np.int64],
        touched: dict[int, None],
    ) -> None:
        """Matched features see one point: that of either, or a new one."""
        for feature, other in zip(here.tolist(), there.tolist(), strict=True):
            own, its = int(mine.points[feature]), int(partner.points[other])
            if its not in self._points:
                its = NO_POINT
            if own == NO_POINT and its == NO_POINT:
                self._points[self._next_point] = GrownPoint([], mine.at_ns)
                self._see(self._next_point, partner, other, touched)
                self._see(self._next_point, mine, feature, touched)
                self._next_point += 1
            elif own == NO_POINT:
                self._see(its, mine, feature, touched)
            elif its == NO_POINT:
                self._see(own, partner, other, touched)

    def _see(self, number: int, kept: KeptKeyframe, feature: int, touched: dict[int, None]) -> None:
        """A feature shows a point; whether that is news is known by then."""
        point = self._points[number]
        kept.points[feature] = number
        if point.slot != NO_SLOT:
            self._point_in_slot.move_to_end(point.slot)
        if point.see(sighting(kept.keyframe, feature, kept.at_ns)):
            touched[number] = None

    def _triangulate(self, numbers: list[int]) -> None:
        """Place the points that were seen anew; those that their rays contradict are none."""
        if not numbers:
            return
        points = [self._points[number] for number in numbers]
        found = triangulate(rays_of(points))
        good = found.errors_px.max(axis=1) <= self.settings.max_error
        wide = found.angles >= np.radians(self.settings.min_angle)
        for number, point, position, is_good, is_wide in zip(numbers, points, found.points, good, wide, strict=True):
            if not is_good:
                self._drop(number)
                continue
            point.position = position
            if point.slot == NO_SLOT and is_wide and self._is_witnessed(point):
                self._settle(number, point)
            elif point.slot != NO_SLOT:
                self._changed[point.slot] = None

    def _is_witnessed(self, point: GrownPoint) -> bool:
        """Whether enough images saw the point, and not all of them at once."""
        at_ns = [one.at_ns for one in point.sightings]
        lasting_s = 1e-9 * (max(at_ns) - min(at_ns))
        return len(at_ns) >= self.settings.min_views and lasting_s >= self.settings.min_lasting

    def _settle(self, number: int, point: GrownPoint) -> None:
        """The point becomes a landmark of the map; where there is no room, the one that was longest unseen goes.

        If all have been seen since, the point has to wait.
        """
        if not self._free and self._never_used == self.map.capacity:
            longest_unseen = next(iter(self._point_in_slot.values()))
            if self._points[longest_unseen].seen_ns >= point.seen_ns:
                return
            self._drop(longest_unseen)
        if self._free:
            point.slot = self._free.pop()
        else:
            point.slot, self._never_used = self._never_used, self._never_used + 1
        # Every landmark of a slot has an id of its own, so that nobody takes it for one before it.
        point.landmark_id = self._next_id[point.slot]
        self._next_id[point.slot] += self.map.capacity
        self._point_in_slot[point.slot] = number
        self._changed[point.slot] = None

    def _drop(self, number: int) -> None:
        point = self._points.pop(number)
        if point.slot != NO_SLOT:
            del self._point_in_slot[point.slot]
            self._free.append(point.slot)
            self._changed[point.slot] = None

    def _keep(self, mine: KeptKeyframe) -> None:
        """Later keyframes are matched with this one, and no more with the oldest, nor with guesses that it showed."""
        gone = self._kept.add(mine)
        for number in [] if gone is None else gone.points.tolist():
            point = self._points.get(number)
            if point is not None and point.slot == NO_SLOT:
                del self._points[number]
