"""Growth of a map while it is in use: keyframes are asked for, and wait for a moment in which nobody needs the map."""

from collections.abc import Callable

from bodycam_ros.camera import CameraModel
from bodycam_ros.mapping.growing_map import GrownLandmarks, growing
from bodycam_ros.mapping.growth_settings import GrowthSettings
from bodycam_ros.mapping.map_growth import MapGrowth
from bodycam_ros.mapping.worn_keyframe import KeyframeChoice, WornKeyframe, worn_keyframe
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import TrackFrame


class LiveGrowth:
    """One growing map for some cameras.

    Args:
        reference_map: the map that grows; it is not changed itself.
        settings: of the growth.
        want_keyframe: asks a camera's tracker to look for new features.
        soon: calls back once, after what waits by now has been registered.

    Attributes:
        map: what the cameras are registered in.
        is_on: whether anything grows or goes; else the map stays as it is.
        changes: how often the map has changed.
        left_out: keyframes that gave way to a newer one of their camera.
    """

    def __init__(
        self,
        reference_map: ReferenceMap,
        settings: GrowthSettings,
        want_keyframe: Callable[[str], None],
        soon: Callable[[Callable[[], None]], None],
    ) -> None:
        self.map = growing(reference_map, settings.capacity)
        self.is_on = settings.enabled
        self.changes = self.left_out = 0
        self._settings = settings
        self._want_keyframe, self._soon = want_keyframe, soon
        self._cameras: dict[str, CameraModel] = {}
        self._choices: dict[str, KeyframeChoice] = {}
        self._asked_ns: dict[str, int] = {}
        self._waiting: dict[str, WornKeyframe] = {}
        self._growth = MapGrowth(self.map, self._cameras, settings)

    @property
    def landmarks(self) -> int:
        """Landmarks that have grown and are there."""
        return self._growth.landmarks

    @property
    def keyframes(self) -> int:
        """Keyframes that new ones are matched with."""
        return self._growth.keyframes

    def begin(self, camera: str, model: CameraModel) -> None:
        """A camera's tracks begin, or begin anew."""
        self._cameras[camera] = model
        self._choices[camera] = KeyframeChoice(model, self._settings)
        self._asked_ns.pop(camera, None)

    def hear(self, frame: TrackFrame, matches: LandmarkMatches) -> None:
        """What a camera saw that has begun, and what was made of it."""
        if not self.is_on:
            return
        camera = matches.camera
        self._growth.hear(matches)
        self._growth.forget_unseen()
        self._take_changes()
        keyframe = worn_keyframe(self._cameras[camera], frame, matches) if frame.keyframe else None
        if keyframe is not None:
            self._choices[camera].taken(matches)
            self._wait(keyframe)
        elif self._choices[camera].is_due(matches) and self._may_ask(camera, matches.stamp_ns):
            self._asked_ns[camera] = matches.stamp_ns
            self._want_keyframe(camera)

    def forget(self) -> int:
        """Drop all that has grown; how many landmarks that were."""
        dropped = self.landmarks
        self._waiting.clear()
        self._growth.forget()
        self._take_changes()
        return dropped

    def go_on_from(self, grown: GrownLandmarks) -> int:
        """Take landmarks of an earlier run instead of what has grown in this one; how many there was room for."""
        self.forget()
        count = self._growth.remember(grown)
        self._take_changes()
        return count

    def _may_ask(self, camera: str, stamp_ns: int) -> bool:
        """An answer takes the tracker some images, during which one question is enough."""
        passed_ns = stamp_ns - self._asked_ns.get(camera, stamp_ns + 1)
        return not 0 <= passed_ns < 1e9 * self._settings.keyframe_gap

    def _wait(self, keyframe: WornKeyframe) -> None:
        self.left_out += keyframe.camera in self._waiting
        self._waiting[keyframe.camera] = keyframe
        self._soon(self._grow)

    def _grow(self) -> None:
        """By one keyframe, then the others have a turn."""
        if self._waiting and self.is_on:
            self._growth.add(self._waiting.pop(next(iter(self._waiting))))
            self._take_changes()

    def _take_changes(self) -> None:
        self.changes += self._growth.take_changes() is not None
