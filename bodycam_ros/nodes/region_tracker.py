"""Node ``region_tracker``: the images of one static camera in, poses of the body's segments out (B 2)."""

import time
from collections import deque
from functools import partial
from pathlib import Path

from bodycam_ros.body.average_person import with_hands
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import coupled_body, held_equipment
from bodycam_ros.body_state import LatestState
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.errors import StationError
from bodycam_ros.live.node_parameters import REGION_GROUPS, RegionTrackerParameters
from bodycam_ros.messages.diagnostics import Status
from bodycam_ros.messages.segment_poses import (
    SEGMENT_POSES,
    SEGMENT_POSES_TYPE,
    SEGMENTS_NOW,
    latest_state,
    segment_poses_message,
)
from bodycam_ros.nodes.image_stage import ImageStage
from bodycam_ros.nodes.parameters import STAGE_DEPTH, latched, reliable
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.registration.reference_map import load_map
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.single_camera import SingleCamera
from bodycam_ros.static_cameras.start_file import PlacedBody
from bodycam_ros.static_cameras.stations_file import read_stations
from bodycam_ros.static_cameras.surface import BodySurface
from bodycam_ros.static_cameras.surface_folder import surfaces_of

_START_WAIT_S = 0.5
"""With a start file the first image waits so long for a solver that has the body already, as after a restart."""


class RegionStage(ImageStage[RegionTrackerParameters]):
    """Measures the segments of the body in each image of a static camera.

    Images wait for a reader, and, except for ``most_ahead`` of them, for the solver's answer: one static camera alone
    does not measure the distance of a limb, and follows it well only from the estimate of all cameras. The initial
    estimate is the solver's; if there is none after half a second, that of the start file.
    """

    name, parameters_type, groups = "region_tracker", RegionTrackerParameters, REGION_GROUPS

    def __init__(self, node: StageNode[RegionTrackerParameters]) -> None:
        super().__init__(node)
        given = self.parameters
        file, path = Path(self.required("stations")), Path(self.required("body"))
        reference_map = load_map(Path(given.map)) if given.map else None
        stations = read_stations(file, reference_map)
        if self.camera not in stations:
            raise StationError(f"{file}: there is no camera {self.camera}; it has {', '.join(stations)}")
        person = with_hands(read_body(path))
        equipment = held_equipment(given.equipment, person) if given.equipment else None
        self._body: BodyModel = coupled_body(person, equipment)
        self._station = stations[self.camera]
        surfaces = surfaces_of(self._body, path, Path(given.surface) if given.surface else None)
        self._surface = BodySurface.of(self._body, surfaces)
        self._placed: PlacedBody | None = None
        if given.start:
            from bodycam_ros.formats.read_captured import read_start  # it loads SciPy, which few nodes need

            self._placed = read_start(Path(given.start), file, stations, self._body)
        self._latest: deque[LatestState] = deque(maxlen=2)
        self._poses = self.publisher(SEGMENT_POSES_TYPE, f"{self.camera}{SEGMENT_POSES}", reliable(STAGE_DEPTH))
        solved = SEGMENT_POSES_TYPE, SEGMENTS_NOW, partial(latest_state, body=self._body)
        self.converted_subscription(*solved, self._add_body, "bodies dropped", latched(STAGE_DEPTH), even_inactive=True)
        self.forget()
        self.subscribe_images()
        self.trigger("~/reset", self._reset)

    def pause(self) -> None:
        """Drop the images, and keep the solver's estimate, which goes on meanwhile."""
        self.drop_images()
        latest = [*self._latest]
        self.restart()
        for now in latest:
            self._set_body(now)

    def forget(self) -> None:
        """Forget the body and its colours."""
        alone = {self.camera: self._station}
        tracker = RegionTracker(self._body, self._surface, alone, self.settings.region)
        self._alone = SingleCamera(self.camera, tracker, self._placed, self.settings.motion)
        self.unanswered.clear()
        self._latest.clear()
        self._answered_ns = self._solved_ns = 0
        self._processing_since_s: float | None = None

    def is_outdated(self) -> bool:
        """Whether the solver is past the next image."""
        return self.images[0].image.stamp_ns <= self._solved_ns <= self.images[-1].image.stamp_ns

    def waiting_reason(self) -> str:
        """Reason why the next image has to wait."""
        if not self._poses.get_subscription_count():
            return f"no node reads {self.camera}{SEGMENT_POSES}"
        if self.unanswered.must_wait():
            return "the solver has not answered yet"
        if self._alone.has_pose(self.images[0].image.stamp_ns):
            return ""
        if self._placed is None:
            return f"there is no estimate of the body on {SEGMENTS_NOW}, and no start file"
        waited_s = time.monotonic() - self.images[0].arrival_s
        return "" if waited_s >= _START_WAIT_S else "the solver may have an estimate of the body"

    def processing_since_s(self) -> float:
        """The first image takes long, for limbs are searched; images that wait meanwhile do not count."""
        return self._processing_since_s or time.monotonic()

    def process(self, image: CameraImage, arrival_s: float) -> None:
        """Measure the segments in an image."""
        measured = self._alone.measure(image)
        self._processing_since_s = self._processing_since_s or time.monotonic()
        if measured is None:
            size = f"{self._station.camera.width}x{self._station.camera.height}"
            reason = f"camera {self.camera}: the image of stamp {image.stamp_ns} ns is not of {size} px"
            self.dropped.add("images unusable", reason)
            return
        self.unanswered.add(measured.stamp_ns)
        # A solver that is ahead did not wait for this image, and will not answer it.
        self.unanswered.answer_until(self._answered_ns)
        confidence = measured.confidence
        self._poses.publish(
            segment_poses_message(self.make, measured.stamp_ns, self.camera, measured.evidence, confidence)
        )
        tally = self.tally
        tally.add_image(arrival_s)
        tally.segments.update(each.segment for each in measured.evidence)
        tally.confidence += sum(confidence[each.segment] for each in measured.evidence)

    def _reset(self) -> str:
        self.restart()
        return f"camera {self.camera} restarts: the initial estimate is the solver's, or the start file's"

    def _add_body(self, now: LatestState) -> None:
        self._set_body(now)
        self.call_later(self.process_next)

    def _set_body(self, now: LatestState) -> None:
        self._latest.append(now)
        self._alone.add_state(now)
        self._solved_ns = now.stamp_ns
        self._answered_ns = now.stamp_ns + round(1e9 * self.settings.assembler.sync_tolerance)
        self.unanswered.answer_until(self._answered_ns)

    def report(self) -> list[Status]:
        """Status of the camera since the last report."""
        tally = self.tally
        observed = tally.segments.total()
        values = {
            "segments per image": tally.mean(observed),
            "confidence": round(tally.confidence / observed, 2) if observed else "none",
            "unobserved": ", ".join(s for s in self._body.segments if not tally.segments[s]) or "none",
        }
        error = "" if observed else "no segment of the body is observed; is it in front of the camera?"
        return [self.status(values, error)]


make = partial(StageNode, RegionStage)
"""Constructor of the node."""
