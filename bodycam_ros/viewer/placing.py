"""A person places a body over the first images of static cameras: the start of a solve by these cameras alone."""

import logging
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from bodycam_ros.body.average_person import body_of_height, with_hands
from bodycam_ros.body.body_edit import joint_named
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.surface import BodySurface
from bodycam_ros.body.surface_folder import surfaces_of
from bodycam_ros.camera.camera_image import decode_colour
from bodycam_ros.errors import RecordingError
from bodycam_ros.files.shown import markdown_text
from bodycam_ros.formats.read_captured import read_start
from bodycam_ros.formats.static_cameras_file import world_T_file
from bodycam_ros.geometry import Array, inverse
from bodycam_ros.recording.bag_reader import Recording, open_recording
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.replaying.static_input import read_recorded_static_cameras
from bodycam_ros.static_cameras.detected_people import detect_people
from bodycam_ros.static_cameras.placement import Placement, standing_in_view
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.segment_support import CONFIRMED
from bodycam_ros.static_cameras.start_file import AUTO, StaticCameraFiles, write_start
from bodycam_ros.static_cameras.static_camera import Image, StaticCamera
from bodycam_ros.viewer.correction import Part
from bodycam_ros.viewer.editor import Editor
from bodycam_ros.viewer.motion import Motion
from bodycam_ros.viewer.placing_picture import PlacingPicture
from bodycam_ros.viewer.scene import WORLD, Scene
from bodycam_ros.viewer.server import LocalServer, Page

logger = logging.getLogger(__name__)

_AT_ONCE_NS = 100_000_000  # as long a start is known; a camera that starts later shows the person elsewhere
_FITS = 3  # each moves a segment by some centimetres at most
_PICTURE_PANEL_PX = 600
_POSSIBLE = 0.48  # support of a segment that may be where it is; those that were off by 15 cm had less

_HELP = "Place the pelvis first, then head, hands and feet, then knees and elbows. Drag the handles. Then fit."


class PlacingSources:
    """What a start is made of; without a start in ``files`` the body stands where the cameras look.

    Args:
        recording_path: bag with images of the static cameras.
        files: of the static cameras.
        body: its file, or the height [m] of an average person.
        map_path: map folder, where the static cameras are in a map.

    Attributes:
        images: camera -> its first image (H, W, 3) blue, green, red.
        tracker: of the body in these images; its body has hands, and limits at all joints of a person.
        surfaces: segment -> surface.
        placement: the body where it is at first.
        reference_map: the place; None without one.

    Raises:
        BodycamError: one of the files is missing or damaged, or they do not fit each other.
    """

    def __init__(self, recording_path: Path, files: StaticCameraFiles, body: Path | float, map_path: Path | None):
        body_path = body if isinstance(body, Path) else Path()
        person = with_hands(read_body(body)) if isinstance(body, Path) else body_of_height(body, "person")
        self.reference_map = None if map_path is None else ReferenceMap.load(map_path)
        with open_recording(recording_path) as recording:
            stations = read_recorded_static_cameras(files, self.reference_map, recording, person)
            self.images = _first_images(recording, stations)
        self.surfaces = surfaces_of(person, body_path, files.surface)
        self.tracker = RegionTracker(person, BodySurface.of(person, self.surfaces), stations, RegionSettings())
        if files.start is None:
            poses = standing_in_view(self.tracker.body, [stations[name] for name in self.images])
        else:
            people = detect_people([self.images], self.images) if files.start == AUTO else None
            placed = read_start(files.start, files.stations, stations, person, files.person, people)
            poses = placed.world_T_segment
        self.placement = Placement(self.tracker.body, poses)
        self._file_T_world = inverse(world_T_file(files.stations, stations))

    def fit(self, poses: Array) -> tuple[Array, Array]:
        """Poses (S, 4, 4) of a body, moved onto its images from poses (S, 4, 4), and their support (S,) in these."""
        for _ in range(_FITS):
            poses = self.tracker.initialise(self.images, poses)
        return poses, self.tracker.support(self.images, poses)

    def write(self, output: Path, poses: Array) -> None:
        """Write the start with the body at poses (S, 4, 4); raises as ``write_start``."""
        segments = self.placement.body.segments
        write_start(output, dict(zip(segments, self._file_T_world @ poses, strict=True)))


def _first_images(recording: Recording, stations: Mapping[str, StaticCamera]) -> dict[str, Image]:
    """Camera -> its first image, of the cameras that have one at about the time of the very first.

    Raises:
        RecordingError: there is no image, or one cannot be decoded or has another size than the camera's lens is for.
    """
    first = {name: image for name in stations if (image := next(recording.images([name]), None))}
    if not first:
        raise RecordingError(f"{recording.path}: has no image of {', '.join(stations)}")
    start_ns = min(image.stamp_ns for image in first.values())
    images, late_s = {}, {}
    for name, image in first.items():
        late_ns = image.stamp_ns - start_ns
        if late_ns > _AT_ONCE_NS:
            late_s[name] = 1e-9 * late_ns
        else:
            images[name] = decode_colour(image)
            stations[name].check_size(images[name])
    if late_s:
        logger.warning(
            "%d of %d static cameras are not shown, since their first images are late: %s",
            len(late_s), len(first), ", ".join(f"{name} by {late:.1f} s" for name, late in late_s.items()),
        )  # fmt: skip
    return images


class PlacingSession(Page):
    """The page of one start, which is written to ``output``."""

    def __init__(self, server: LocalServer, sources: PlacingSources, output: Path) -> None:
        super().__init__(server)
        self._sources, self._output = sources, output
        body, poses = sources.placement.body, sources.placement.poses
        self._written = poses
        self._scene = Scene(
            server,
            body,
            sources.reference_map,
            Motion.standing(body),
            self._click,
            {name: view.station for name, view in sources.tracker.views.items()},
            lambda _: sources.surfaces,
        )
        self._pictures = PlacingPicture(body, sources.tracker.views, sources.images)
        panel = server.gui.add_panel()
        with panel.add_tab("First images"):
            close_up = server.gui.add_checkbox("close up", False)
            self._image = server.gui.add_image(self._pictures.draw(poses, body.root), format="jpeg")
        panel.dock_left()
        panel.set_width(_PICTURE_PANEL_PX)
        self._editor = Editor(
            server,
            "Place",
            _HELP,
            {segment: segment for segment in body.segments},
            sources.placement,
            output.name,
            select=self._select,
            changed=self._show_step,
            write=self._write,
        )
        with self._editor.folder:
            server.gui.add_button("Fit").on_click(server.when_pressed(self._fit))
        server.on_input(close_up, self._cut)
        self._select(body.root)
        self._scene.frame_body()

    @property
    def _placement(self) -> Placement:
        return self._editor.edited

    @property
    def unwritten(self) -> str:
        """The start, if the body is elsewhere than in it."""
        return "" if self._placement.poses is self._written else f"{self._output}: the last steps"

    def _click(self, part: Part) -> None:
        if part.kind == "joint":
            self._select(joint_named(self._placement.body, part.name).child)

    def _select(self, segment: str) -> None:
        self._selected = segment
        joint = self._placement.body.joint_to_parent(segment)
        self._scene.select(None if joint is None else Part("joint", joint.name))
        self._show()

    def _show_step(self) -> None:
        self._editor.remark("")
        self._show()

    def _show(self) -> None:
        """Show the body where it is now."""
        placement, segment = self._placement, self._selected
        self._scene.pose(placement.poses)
        self._image.image = self._pictures.draw(placement.poses, segment)
        self._editor.show(segment, WORLD, placement.pose_of(segment), can_move=placement.can_move(segment))

    def _fit(self) -> None:
        self._editor.remark("fitting")
        poses, support = self._sources.fit(self._placement.poses)
        self._editor.change(replace(self._placement, poses=poses))
        segments = self._placement.body.segments
        self._editor.remark(support_table(dict(zip(segments, support.tolist(), strict=True))))

    def _write(self) -> None:
        self._sources.write(self._output, self._placement.poses)
        self._written = self._placement.poses
        self.server.notify("Written", f"{self._output}; replay with --start {self._output}", "green")

    def _cut(self, is_close_up: bool) -> None:
        self._pictures.cut(is_close_up)
        self._show()


def support_table(support: Mapping[str, float]) -> str:
    """Markdown of how well the images support each segment where it is, the least first; NaN: they do not show it."""
    lines = ["| segment | is in the images |", "|---|---|"]
    for segment, share in sorted(support.items(), key=lambda item: (np.isnan(item[1]), item[1])):
        word = "yes" if share >= CONFIRMED else "perhaps" if share >= _POSSIBLE else "**no: move it**"
        word = "hidden" if np.isnan(share) else f"{word} ({share:.2f})"
        lines.append(f"| {markdown_text(segment.replace('_', ' '))} | {word} |")
    return "\n".join(lines)
