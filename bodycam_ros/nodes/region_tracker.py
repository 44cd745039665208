"""Node ``region_tracker``: the images of one static camera in, what it says of the body's segments out (B 2)."""

import time
from collections import deque
from functools import partial
from pathlib import Path

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import coupled_body, held_equipment
from bodycam_ros.body_state import BodyNow, SaidSegments
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.errors import StationError
from bodycam_ros.formats.read_captured import read_joint_points
from bodycam_ros.live.flow_of_frames import AnsweredFrames, Ordered
from bodycam_ros.live.image_queue import ImageHealth, ImageQueue, QueuedImage
from bodycam_ros.live.node_parameters import REGION_GROUPS, RegionTrackerParameters
from bodycam_ros.live.static_cameras import read_world
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.health import Health
from bodycam_ros.messages.segment_poses import (
    SEGMENT_POSES,
    SEGMENT_POSES_TYPE,
    SEGMENTS_NOW,
    SEGMENTS_NOW_TYPE,
    segment_poses_message,
    segments_now,
)
from bodycam_ros.nodes.camera_topics import ImageSource
from bodycam_ros.nodes.parameters import STAGE_DEPTH, latched, reliable
from bodycam_ros.nodes.stage_node import Stage, StageNode
from bodycam_ros.static_cameras.body_shape import BodySurface
from bodycam_ros.static_cameras.person_model import with_hands
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.single_camera import SingleCamera
from bodycam_ros.static_cameras.start_file import placed_body
from bodycam_ros.static_cameras.surface_folder import surfaces_of
from bodycam_ros.tracking.every_second_image import EverySecondImage

_LOOK_S = 0.25
_NOBODY = f"nothing on {SEGMENTS_NOW} says where the body is, and there is no start file"


class RegionStage(Stage[RegionTrackerParameters]):
    """Says what each image of one station shows of the body.

    Images wait until somebody reads what is said, and, but for ``most_ahead`` of them, until the solver has answered:
    one station alone does not see how far away a limb is, and follows it well only from where all have it. At first it
    looks where the solver has the body; if the solver says nothing for ``start_wait``, where the start file has it.
    After it was inactive, it looks where the solver has the body by then.
    """

    name, parameters_type, groups = "region_tracker", RegionTrackerParameters, REGION_GROUPS

    def __init__(self, node: StageNode[RegionTrackerParameters]) -> None:
        super().__init__(node)
        of = self.parameters
        self.camera = self.required("camera")
        file, path = Path(self.required("stations")), Path(self.required("body"))
        stations = read_world(file, of.map)
        if self.camera not in stations:
            raise StationError(f"{file}: there is no camera {self.camera}; it has {', '.join(stations)}")
        person = with_hands(read_body(path))
        self._body: BodyModel = coupled_body(person, held_equipment(of.equipment, person) if of.equipment else None)
        self._station = stations[self.camera]
        surfaces = surfaces_of(self._body, path, Path(of.surface) if of.surface else None)
        self._surface = BodySurface.of(self._body, surfaces)
        self._placed = (
            placed_body(Path(of.start), file, stations, self._body, read_joint_points(Path(of.start)))
            if of.start
            else None
        )
        self._answers = AnsweredFrames(of.most_ahead)
        self._thinning = EverySecondImage(of.longest_wait, of.recovery)
        self._begun_with: Ordered[QueuedImage] | None = None
        self._lately: deque[BodyNow] = deque(maxlen=2)
        self._said = self.publisher(SEGMENT_POSES_TYPE, f"{self.camera}{SEGMENT_POSES}", reliable(STAGE_DEPTH))
        self.subscription(SEGMENTS_NOW_TYPE, SEGMENTS_NOW, self._on_body, latched(STAGE_DEPTH), even_inactive=True)
        self._images = ImageQueue(
            self.camera,
            self.skipped,
            self.moments,
            of.image_queue,
            self._thinning,
            lambda: self.soon(self._look_next),
            lambda: self._waits_for() or "images come faster than they are looked at",
        )
        self._health = ImageHealth(self.camera, self._images, self.skipped)
        self._begin()
        self._source = ImageSource(self, self.camera, of.transport, of.image_queue, self._images.receive)
        self.every(_LOOK_S, self._look)
        self.trigger("~/reset", self._reset)

    def pause(self) -> None:
        """Where the body is, the solver says, and goes on doing so."""
        self._images.forget()
        lately = [*self._lately]
        self._restart()
        for now in lately:
            self._hear(now)

    def _reset(self) -> tuple[bool, str]:
        self._restart()
        return True, f"camera {self.camera} begins anew: where the body is, the solver has to say, or the start file"

    def settings_changed(self) -> None:
        """Wait, and run ahead, as is said now."""
        of = self.parameters
        self._answers.most_ahead = of.most_ahead
        self._thinning.longest_wait_s, self._thinning.recovery_s = of.longest_wait, of.recovery

    def _restart(self) -> None:
        self._health.restarts += 1
        self._begin()

    def _begin(self) -> None:
        """Nothing is known of the body and its colours."""
        alone = {self.camera: self._station}
        tracker = RegionTracker(self._body, self._surface, alone, self.settings.region)
        self._alone = SingleCamera(self.camera, tracker, self._placed, self.settings.motion)
        self._answers.forget()
        self._lately.clear()
        self._answered_ns = self._solved_ns = 0
        self._asked_since_s: float | None = None
        self._looking_since_s: float | None = None

    def _on_body(self, message: Message) -> None:
        try:
            now = segments_now(message, self._body)
        except ValueError as error:
            self.skipped.add("bodies skipped", f"{SEGMENTS_NOW}: {error}; is it the solver of another body?")
            return
        self._hear(now)
        self.soon(self._look_next)

    def _hear(self, now: BodyNow) -> None:
        self._lately.append(now)
        self._alone.add_state(now)
        self._solved_ns = now.stamp_ns
        self._answered_ns = now.stamp_ns + round(1e9 * self.settings.assembler.sync_tolerance)
        self._answers.answered_until(self._answered_ns)

    def _look(self) -> None:
        self._images.look()
        self._look_next()

    def _look_next(self) -> None:
        if not len(self._images):
            return
        following = self._images.next
        if following.begins_anew and following is not self._begun_with:
            # Once: it may have to wait here.
            self._begun_with = following
            self.log.warning(f"camera {self.camera}: the time of its images goes back; it begins anew")
            self._restart()
        self._asked_since_s = self._asked_since_s or time.monotonic()
        if following.item.image.stamp_ns <= self._solved_ns <= self._images.newest_ns:
            self._leave_out()
            return
        if self._waits_for():
            return
        image = self._images.take(self._looking_since_s or time.monotonic())
        if image is not None:
            self._look_at(image, following.item.seconds)
        # The first takes long, for limbs are looked for; that others wait meanwhile is no sign of a slow machine.
        self._looking_since_s = self._looking_since_s or time.monotonic()
        # One image at a time, so that the solver is heard in between however many images wait.
        self.soon(self._look_next)

    def _waits_for(self) -> str:
        """What the next image waits for; empty if for nothing."""
        if not self._said.get_subscription_count():
            return f"nobody reads {self.camera}{SEGMENT_POSES}"
        if self._answers.must_wait():
            return "the solver has not answered yet"
        if self._alone.has_pose(self._images.next.item.image.stamp_ns):
            return ""
        if self._placed is None:
            return _NOBODY
        asked_s = time.monotonic() - (self._asked_since_s or time.monotonic())
        return "" if asked_s >= self.parameters.start_wait else "a moment, for the solver may know where the body is"

    def _leave_out(self) -> None:
        """The solver has been there already: whatever the next image shows, it would be said too late."""
        if self._images.take(time.monotonic()) is not None:
            self.skipped.add("images late", f"camera {self.camera}: the solver has gone on without one of its images")
        self.soon(self._look_next)

    def _look_at(self, image: CameraImage, came_s: float) -> None:
        said = self._alone.measure(image)
        if said is None:
            size = f"{self._station.camera.width}x{self._station.camera.height}"
            reason = f"camera {self.camera}: the image of stamp {image.stamp_ns} ns is none of {size} px"
            self.skipped.add("images skipped", reason)
            return
        self._answers.sent(said.stamp_ns)
        # A solver that is ahead, for it did not wait, will not answer to this any more.
        self._answers.answered_until(self._answered_ns)
        self._said.publish(segment_poses_message(self.make, said.stamp_ns, self.camera, said.evidence, said.confidence))
        self._count(said, came_s)

    def _count(self, said: SaidSegments, came_s: float) -> None:
        tally = self._health.tally
        tally.images, tally.latency_s = tally.images + 1, tally.latency_s + time.monotonic() - came_s
        tally.seen.update(each.segment for each in said.evidence)
        tally.confidence += sum(said.confidence[each.segment] for each in said.evidence)

    def health(self) -> list[Health]:
        """How the images of the last second fared."""
        source, lacking = self._source, self._waits_for() if len(self._images) else ""
        segments = tuple(self._body.segments)
        return [self._health.of_region_tracker(source.quiet_s, source.what_is_wrong(), lacking, segments)]


make = partial(StageNode, RegionStage)
"""Makes the node."""
