"""Map extension by keyframes of registered body cameras: relative registration (A 4.1, second half).

The paper matches every newly registered image with the others, triangulates, and adjusts with the reference structure
fixed. Here keyframes of all cameras are processed in order of time; ``adjust`` is the adjustment.
"""

from collections import OrderedDict, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array
from bodycam_ros.mapping.body_keyframe import MAX_SIGMA_M, BodyKeyframe
from bodycam_ros.mapping.epipolar_matching import match_posed
from bodycam_ros.mapping.extendable_map import VIEWS, AddedLandmarks, ExtendableMap, empty_slots
from bodycam_ros.mapping.local_bundle import KeyframeBundle
from bodycam_ros.mapping.small_photographs import normals_towards
from bodycam_ros.mapping.triangulation import spread_directions, triangulate
from bodycam_ros.registration.map_photographs import MapPhotographs
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import NO_LANDMARK

_KEYFRAMES = 320  # of all cameras that new ones are matched with
_PARTNERS = 8  # keyframes that a new one is matched with
_MIN_AXIS_COSINE = np.cos(np.radians(90.0))  # between optical axes of partners, A section 4.1
_MIN_BASELINE_M = 0.06  # between partners: less is no parallax at a metre
_EPIPOLAR_PX = 2.0  # of a match beside its epipolar line: features and poses err
_MAX_RATIO = 0.85  # best to second best distance along the epipolar line (Lowe 2004)
_MAX_DISTANCE = 230.0  # between RootSIFT vectors of length 512
_MAX_ERROR_PX = 1.0  # largest reprojection error, A section 4.1
_MIN_ANGLE = np.radians(2.0)  # least angle between two rays, A section 4.1
_MIN_VIEWS = 3  # keyframes: two rays always nearly meet, the third reveals a wrong match
_MIN_DURATION_NS = 200_000_000  # between first and last view: what several cameras see at once may be moving
_MAX_SIGHTINGS = 10  # rays that a point keeps: those farthest from each other, which constrain it most

NO_SLOT, REMOVED = -1, -2


@dataclass(eq=False)
class View:
    """An image that shows points, and its pose (4, 4), which the bundle adjustment moves."""

    camera: str
    stamp_ns: int
    focal_px: float
    world_T_camera: Array


@dataclass(frozen=True)
class Sighting:
    """One feature of one keyframe: a unit ray (3,) in the axes of the view's camera, and its descriptor."""

    view: View
    ray: Array
    descriptor: NDArray[np.uint8]
    size: float


@dataclass(eq=False)
class MapPoint:
    """A point and its sightings.

    Attributes:
        sightings: up to some, in order of time.
        position: (3,) [m].
        slot: of the extendable map; ``NO_SLOT`` until it is a landmark, ``REMOVED`` once it is none any more.
        landmark_id: its id in the map then. A landmark of an earlier run has no sightings, and is never refined.
    """

    sightings: list[Sighting] = field(default_factory=list)
    position: Array = field(default_factory=lambda: np.zeros(3))
    slot: int = NO_SLOT
    landmark_id: int = 0

    def add(self, sighting: Sighting) -> bool:
        """Add a sighting; whether it is kept. An image counts once, however many of its features show the point."""
        is_of_earlier_run = self.slot >= 0 and not self.sightings
        if is_of_earlier_run or any(own.view is sighting.view for own in self.sightings):
            return False
        if len(self.sightings) >= _MAX_SIGHTINGS:
            directions = np.array([own.view.world_T_camera[:3, :3] @ own.ray for own in (*self.sightings, sighting)])
            cosines = np.tril(directions[:-1] @ directions[:-1].T, -1)
            if (directions[:-1] @ directions[-1]).max() >= cosines.max():
                return False
            del self.sightings[int(cosines.argmax()) // len(cosines)]
        self.sightings.append(sighting)
        return True

    def write(self, into: np.void) -> None:
        """Write the landmark (``ADDED``): descriptors from directions far from each other, the nearest first."""
        towards = np.array([s.view.world_T_camera[:3, 3] for s in self.sightings]) - self.position
        distances = np.linalg.norm(towards, axis=1)
        towards /= distances[:, None]
        order = np.argsort(distances, kind="stable")
        rows = order[spread_directions(towards[order], VIEWS)]
        chosen = [self.sightings[row] for row in rows.tolist()]
        into["landmark_id"], into["point_world"] = self.landmark_id, self.position
        into["descriptors"], into["views"] = [s.descriptor for s in chosen], towards[rows]
        into["sizes"] = distances[rows] * [s.size for s in chosen]


@dataclass(frozen=True)
class KeptImage:
    """An image of a body camera that a map keeps; ``jpeg`` is the grey picture, ``world_T_camera`` (4, 4)."""

    camera: str
    stamp_ns: int
    world_T_camera: NDArray[np.float64]
    jpeg: bytes


@dataclass
class _Keyframe:
    """A keyframe, its view, and the point (N,) that each feature shows."""

    keyframe: BodyKeyframe
    view: View
    points: list[MapPoint | None]

    def point(self, feature: int) -> MapPoint | None:
        """The point that a feature shows, if it was not removed."""
        point = self.points[feature]
        return None if point is None or point.slot == REMOVED else point


class LocalMapper:
    """Adds landmarks to a map, and removes those that turn out wrong, or that others need the room of.

    Args:
        extendable_map: receives the landmarks in its slots; reference landmarks never move.
        partners: keyframes that each new one is matched with.

    Attributes:
        map: the map.
    """

    def __init__(self, extendable_map: ExtendableMap, partners: int = _PARTNERS) -> None:
        self.map = extendable_map
        self._max_partners = partners
        self._waiting: list[BodyKeyframe] = []
        self._kept: deque[_Keyframe] = deque(maxlen=_KEYFRAMES)
        self._landmarks: OrderedDict[int, MapPoint] = OrderedDict()  # by slot, the longest without a sighting first
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

    def restore(self, added: AddedLandmarks) -> int:
        """Begin with the added landmarks of an earlier run; returns how many there was room for.

        They are the first to be replaced until they are observed again.
        """
        restored = added[: self.map.capacity].copy()
        for one in restored:
            point = MapPoint(position=one["point_world"].copy())
            self._insert(point)
            one["slot"], one["landmark_id"] = point.slot, point.landmark_id
        self._changed.clear()
        self.map.update(restored)
        return len(restored)

    def wait_for_turn(self, keyframe: BodyKeyframe, most: int | None = None) -> int:
        """Keep a keyframe for ``add_waiting``; how many of those that wait were dropped, as ``most`` may wait."""
        self._waiting.append(keyframe)
        dropped = 0 if most is None else max(0, len(self._waiting) - most)
        del self._waiting[:dropped]
        return dropped

    def add_waiting(self, count: int | None = None) -> AddedLandmarks | None:
        """Extend the map by so many of the keyframes that wait, or all, the earliest first; the changes."""
        # The same order however the cameras are shared among processes.
        self._waiting.sort(key=lambda keyframe: (keyframe.stamp_ns, keyframe.camera))
        for keyframe in self._waiting[:count]:
            self.add_keyframe(keyframe)
        del self._waiting[:count]
        return self.take_changes()

    def add_keyframe(self, keyframe: BodyKeyframe) -> None:
        """Extend the map by one more keyframe."""
        if keyframe.position_sigma > MAX_SIGMA_M:
            return
        ids = keyframe.landmark_ids
        view = View(keyframe.camera, keyframe.stamp_ns, keyframe.focal_length, keyframe.world_T_camera)
        mine = _Keyframe(keyframe, view, [None] * len(ids))
        touched: dict[MapPoint, None] = {}
        # Added landmarks that are observed again.
        for feature in np.flatnonzero((ids >= self.map.first_id) & (ids != NO_LANDMARK)).tolist():
            point = self._landmarks.get((int(ids[feature]) - self.map.first_id) % self.map.capacity)
            if point is not None and point.landmark_id == ids[feature]:
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

    def image_poses(self) -> dict[tuple[str, int], Array]:
        """(camera, stamp [ns]) -> world_T_camera (4, 4) of the images that show added landmarks."""
        views = dict.fromkeys(s.view for point in self.added_points() for s in point.sightings)
        return {(view.camera, view.stamp_ns): view.world_T_camera for view in views}

    def adjust(self) -> None:
        """Adjust the poses of all keyframes that are kept, and the landmarks that they show (A 4.1).

        Reference landmarks are fixed: they anchor the keyframes, which would drift else.
        """
        moving = list(self._kept)
        landmarks = list(dict.fromkeys(p for one in moving for p in one.points if p and p.slot in self._landmarks))
        bundle = KeyframeBundle([point.position for point in landmarks])
        for row, point in enumerate(landmarks):
            for sighting in point.sightings:
                bundle.add(sighting.view, row, sighting.ray)
        for one in moving:
            of, R = one.keyframe, one.view.world_T_camera[:3, :3]
            fixed = of.matched_ids < self.map.first_id
            bundle.anchor(one.view, of.matched_ids[fixed], of.matched_points[fixed], of.matched_rays[fixed] @ R)
        bundle.solve([one.view for one in moving])
        for one in moving:
            one.keyframe = one.keyframe.moved_to(one.view.world_T_camera)
        self._triangulate(landmarks)

    def take_changes(self) -> AddedLandmarks | None:
        """Apply the changes since the last call to the map, and return them for its copies."""
        if not self._changed:
            return None
        changes = empty_slots(np.array(list(self._changed)))
        self._changed.clear()
        for change in changes:
            if (point := self._landmarks.get(change["slot"])) is not None:
                point.write(change)
        self.map.update(changes)
        return changes

    def extended_map(self, images: Sequence[KeptImage], cameras: Mapping[str, CameraModel]) -> ReferenceMap:
        """The map as it is now, with the images that show added landmarks, by which direct registration finds them.

        Args:
            images: of body cameras; those that show no added landmark are left out.
            cameras: models of the body cameras by name.
        """
        reference_map, points = self.map.compact(), self.added_points()
        observed = {(s.view.camera, s.view.stamp_ns) for point in points for s in point.sightings}
        images = [image for image in images if (image.camera, image.stamp_ns) in observed]
        poses = np.array([image.world_T_camera for image in images]).reshape(-1, 4, 4)
        world_T_camera = np.concatenate([reference_map.world_T_camera, poses])
        image_names = (*reference_map.image_names, *[f"{image.camera}/{image.stamp_ns}" for image in images])
        photographs = reference_map.photographs
        if photographs is not None:
            first = len(reference_map.landmark_ids) - len(points)
            view_of = {(image.camera, image.stamp_ns): len(photographs.jpegs) + row for row, image in enumerate(images)}
            observations = [
                (first + row, view)
                for row, point in enumerate(points)
                for view in sorted({view_of[s.view.camera, s.view.stamp_ns] for s in point.sightings})
            ]
            landmarks, views = np.array(observations, np.int64).reshape(-1, 2).T
            towards = world_T_camera[views, :3, 3] - reference_map.points_world[landmarks]
            normals = normals_towards(reference_map.points_world, first, landmarks, towards).astype(np.float32)
            names = sorted({image.camera for image in images})
            taken_by = np.array([len(photographs.cameras) + names.index(image.camera) for image in images], np.uint16)
            photographs = MapPhotographs(
                jpegs=(*photographs.jpegs, *[image.jpeg for image in images]),
                cameras=(*photographs.cameras, *[cameras[name] for name in names]),
                camera_of_view=np.concatenate([photographs.camera_of_view, taken_by]),
                world_T_camera=world_T_camera,
                observation_landmark=np.concatenate([photographs.observation_landmark, landmarks.astype(np.uint32)]),
                observation_view=np.concatenate([photographs.observation_view, views.astype(np.uint16)]),
                normals=np.concatenate([photographs.normals[:first], normals]),
            )
        return replace(reference_map, world_T_camera=world_T_camera, image_names=image_names, photographs=photographs)

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

    def _observe(self, point: MapPoint, kept: _Keyframe, feature: int, touched: dict[MapPoint, None]) -> None:
        """Add a feature's sighting of a point."""
        kept.points[feature] = point
        if point.slot != NO_SLOT:
            self._landmarks.move_to_end(point.slot)
        of = kept.keyframe
        sighting = Sighting(
            view=kept.view,
            ray=of.rays_world[feature] @ kept.view.world_T_camera[:3, :3],
            descriptor=of.descriptors[feature].copy(),  # a slice would keep all of the keyframe
            size=float(of.sizes[feature]),
        )
        if point.add(sighting):
            touched[point] = None

    def _triangulate(self, points: list[MapPoint]) -> None:
        """Triangulate points that have new sightings; remove those that their rays contradict."""
        if not points:
            return
        shape = len(points), max(len(point.sightings) for point in points)
        centres, directions, focal_px = np.zeros((*shape, 3)), np.zeros((*shape, 3)), np.zeros(shape)
        directions[:, :, 2] = 1.0
        for row, point in enumerate(points):
            for column, one in enumerate(point.sightings):
                pose = one.view.world_T_camera
                centres[row, column], directions[row, column] = pose[:3, 3], pose[:3, :3] @ one.ray
                focal_px[row, column] = one.view.focal_px
        found = triangulate(centres, directions, focal_px)
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
                stamps_ns = [sighting.view.stamp_ns for sighting in point.sightings]
                if max(stamps_ns) - min(stamps_ns) >= _MIN_DURATION_NS:
                    self._insert(point)

    def _insert(self, point: MapPoint) -> None:
        """Make a point a landmark; if no slot is free it replaces the one that no keyframe has shown for longest."""
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
