"""A person places a body over the first images of static cameras: the start of a solve by these cameras alone."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from viser import ImageHandle, SceneClickEvent

from bodycam_ros.body.body_edit import joint_named
from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras.placement import Placement, nearest_on_ray
from bodycam_ros.static_cameras.segment_support import CONFIRMED
from bodycam_ros.static_cameras.station import Station
from bodycam_ros.viewer.correction import Part
from bodycam_ros.viewer.gizmo import Gizmo
from bodycam_ros.viewer.inbox import Inbox, set_value
from bodycam_ros.viewer.motion import Motion
from bodycam_ros.viewer.placing_picture import PlacingPicture, pinhole_picture
from bodycam_ros.viewer.placing_sources import PlacingSources
from bodycam_ros.viewer.scene import CAMERAS, Scene
from bodycam_ros.viewer.scene_nodes import WORLD, place
from bodycam_ros.viewer.server import LocalServer

_PICTURE_PANEL_PX = 600
_OUTSIDE = "outside"
_BEHIND = 1.6  # times as far as the body: the image of the camera that the scene is looked at from
_CLOSE_UP_M = 1.2  # above and below the root
_DECIMALS, _STEP_M = 3, 0.01
_POSSIBLE = 0.48  # support of a segment that may be where it is; those that were off by 15 cm had less

_HELP = (
    "Place the pelvis first, then head, hands and feet, then knees and elbows. Drag the handles; or look from a "
    "camera, and shift + click where the segment begins: at its knee, ankle, elbow or wrist. Then fit."
)


def place_body(sources: PlacingSources, output: Path, port: int) -> None:
    """Let a person place a body in a browser until the program is interrupted.

    Args:
        sources: what is shown.
        output: the start to be written.
        port: of this machine; 0 takes any free one.

    Raises:
        BodycamError: the port cannot be used.
    """
    LocalServer(port, f"bodycam view: {output.name}").serve(lambda server: PlacingSession(server, sources, output))


class PlacingSession:
    """One view, as of ``View``."""

    def __init__(self, server: LocalServer, sources: PlacingSources, output: Path) -> None:
        self._server, self._sources, self._output = server, sources, output
        self._placement, self._written = sources.placement, sources.placement.poses
        body = self._placement.body
        self._inbox = inbox = Inbox()
        self._scene = Scene(
            server,
            body,
            sources.reference_map,
            Motion.standing(body),
            lambda part: inbox.put(lambda: self._click(part)),
            {name: view.station for name, view in sources.tracker.views.items()},
            lambda _: sources.surfaces,
        )
        self._gizmo = Gizmo(server.scene, inbox, self._drag)
        self._pictures = PlacingPicture(body, sources.tracker.views, sources.images)
        self._camera = _OUTSIDE
        self._behind: ImageHandle | None = None
        self._add_panels()
        self._select(body.root)
        self._scene.frame_body()

    def _add_panels(self) -> None:
        gui, inbox, body = self._server.gui, self._inbox, self._placement.body
        panel = gui.add_panel()
        with panel.add_tab("First images"):
            self._image = gui.add_image(self._pictures.draw(self._placement.poses, body.root), format="jpeg")
        panel.dock_left()
        panel.set_width(_PICTURE_PANEL_PX)
        with gui.add_folder("Look"):
            through = gui.add_dropdown("from", (_OUTSIDE, *self._sources.images))
            close_up = gui.add_checkbox("close up", False)
        with gui.add_folder("Place"):
            gui.add_markdown(_HELP)
            self._segment = gui.add_dropdown("segment", body.segments)
            self._position = gui.add_vector3("place [m]", (0.0, 0.0, 0.0), step=_STEP_M)
            undo, fit = gui.add_button("Undo"), gui.add_button("Fit")
            write = gui.add_button(f"Write {self._output.name}")
            self._remark = gui.add_markdown("")
        inbox.on_input(self._segment, self._select)
        inbox.on_input(self._position, lambda at: self._move_to(np.array(at)))
        inbox.on_click(undo, lambda: self._change(self._placement.undone()))
        inbox.on_click(fit, self._fit)
        inbox.on_click(write, self._write)
        inbox.on_input(through, self._look_from)
        inbox.on_input(close_up, self._cut)

        @self._server.scene.on_click(modifier="shift")
        def clicked(event: SceneClickEvent) -> None:
            origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
            inbox.put(lambda: self._move_to(nearest_on_ray(origin, direction, self._pose[:3, 3])))

    def step(self) -> None:
        """Do what a person asks for next, or wait for it."""
        if action := self._inbox.take(None):
            action()

    @property
    def unwritten(self) -> str:
        """The start, if the body is elsewhere than in it."""
        return "" if self._placement.poses is self._written else f"{self._output}: the last steps"

    @property
    def _pose(self) -> Array:
        return self._placement.pose_of(self._selected)

    def _click(self, part: Part) -> None:
        if part.kind == "joint":
            self._select(joint_named(self._placement.body, part.name).child)

    def _select(self, segment: str) -> None:
        self._selected = segment
        joint, can_move = self._placement.body.joint_to_parent(segment), self._placement.can_move(segment)
        self._scene.select(None if joint is None else Part("joint", joint.name))
        set_value(self._segment, segment)
        self._position.disabled = not can_move
        self._gizmo.attach(WORLD, self._pose, can_move=can_move)
        self._show()

    def _show(self) -> None:
        """Show the body where it is now."""
        self._scene.pose(self._placement.poses)
        self._image.image = self._pictures.draw(self._placement.poses, self._selected)
        x, y, z = np.round(self._pose[:3, 3], _DECIMALS).tolist()
        set_value(self._position, (x, y, z))

    def _drag(self, pose: Array, continues: bool) -> None:
        self._change(self._placement.moved_to(self._selected, pose, continues=continues))

    def _move_to(self, place_world: Array) -> None:
        """Move the selected segment's origin."""
        pose = self._pose.copy()
        pose[:3, 3] = place_world
        # A field that loses the focus sends its number again.
        is_elsewhere = not np.array_equal(*np.round([pose[:3, 3], self._pose[:3, 3]], _DECIMALS))
        if is_elsewhere and self._placement.can_move(self._selected):
            self._change(self._placement.moved_to(self._selected, pose))

    def _change(self, placement: Placement) -> None:
        self._placement, self._remark.content = placement, ""
        self._gizmo.follow(self._pose)
        self._show()

    def _fit(self) -> None:
        self._remark.content = "fitting"
        poses, support = self._sources.fit(self._placement.poses)
        self._change(self._placement.changed(poses))
        self._remark.content = support_table(dict(zip(self._placement.body.segments, support.tolist(), strict=True)))

    def _write(self) -> None:
        self._sources.write(self._output, self._placement.poses)
        self._written = self._placement.poses
        self._server.notify("Written", f"{self._output}; replay with --start {self._output}", "green")

    def _cut(self, is_close_up: bool) -> None:
        self._pictures.cut(is_close_up)
        self._look_from(self._camera)
        self._show()

    def _look_from(self, camera: str) -> None:
        """Show the scene from a static camera, its image behind the body; or from outside."""
        self._camera = camera
        self._scene.show_layer(CAMERAS, camera == _OUTSIDE)
        if self._behind is not None:
            self._behind.remove()
            self._behind = None
        if camera == _OUTSIDE:
            self._scene.frame_body()
            return
        station, root = self._sources.tracker.views[camera].station, self._placement.pose_of(self._placement.body.root)
        position, lens = station.world_T_camera[:3, 3], station.camera
        distance_m = float(np.linalg.norm(root[:3, 3] - position))
        pixels = pinhole_picture(station, self._sources.images[camera])
        self._behind = _add_picture(self._server, station, pixels, _BEHIND * distance_m)
        if self._pictures.is_close_up:
            half, look_at = np.arctan2(_CLOSE_UP_M, distance_m), root[:3, 3]
        else:
            half, look_at = np.arctan2(lens.height / 2.0, lens.fy), position + station.world_T_camera[:3, 2]
        self._scene.look_from(position, look_at, -station.world_T_camera[:3, 1], 2.0 * float(half))


def _add_picture(server: LocalServer, station: Station, pixels: NDArray[np.uint8], depth_m: float) -> ImageHandle:
    """A pinhole camera's picture at a depth before it, where each pixel is on its ray."""
    camera = station.camera
    per_pixel = depth_m / np.array([camera.fx, camera.fy])
    shown = server.scene.add_image(
        f"{WORLD}/picture",
        pixels,
        float(camera.width * per_pixel[0]),
        float(camera.height * per_pixel[1]),
        format="jpeg",
        cast_shadow=False,
        receive_shadow=False,
    )
    middle = per_pixel * [(camera.width - 1) / 2.0 - camera.cx, (camera.height - 1) / 2.0 - camera.cy]
    pose = station.world_T_camera.copy()
    pose[:3, 3] += pose[:3, :3] @ [*middle, depth_m]
    place(shown, pose)
    return shown


def support_table(support: Mapping[str, float]) -> str:
    """Markdown of how well the images support each segment where it is, the least first; NaN: they do not show it."""
    lines = ["| segment | is in the images |", "|---|---|"]
    for segment, share in sorted(support.items(), key=lambda item: (np.isnan(item[1]), item[1])):
        word = "yes" if share >= CONFIRMED else "perhaps" if share >= _POSSIBLE else "**no: move it**"
        word = "hidden" if np.isnan(share) else f"{word} ({share:.2f})"
        lines.append(f"| {segment.replace('_', ' ')} | {word} |")
    return "\n".join(lines)
