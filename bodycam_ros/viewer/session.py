"""The view of a solved recording: what happens when a person uses it."""

import numpy as np

from bodycam_ros.geometry import Array, inverse, log_so3
from bodycam_ros.results.camera_picture import CameraPicture
from bodycam_ros.results.footage import Footage
from bodycam_ros.viewer.correction import Correction, Part, can_turn, place_of
from bodycam_ros.viewer.editor import Editor
from bodycam_ros.viewer.inbox import Inbox
from bodycam_ros.viewer.panels import CurvePanel, PicturePanel, TimePanel, add_switches
from bodycam_ros.viewer.scene import Scene, segment_name, surface_reader
from bodycam_ros.viewer.server import LocalServer
from bodycam_ros.viewer.sources import Sources

_FRAME_S = 1.0 / 30.0
"""Between two pictures of a recording that is being played."""

_NO_PART = "nothing"


def view(sources: Sources, port: int) -> None:
    """Show a body in a browser until the program is interrupted.

    Args:
        sources: what is shown; its body is from a file.
        port: of this machine; 0 takes any free one.

    Raises:
        BodycamError: the surface or the port cannot be used.
    """
    LocalServer(port, f"bodycam view: {sources.body.name}").serve(lambda server: Session(server, sources))


class Session:
    """One view, as of ``View``."""

    def __init__(self, server: LocalServer, sources: Sources) -> None:
        assert sources.body_file is not None
        self._body_file = sources.body_file
        self._server, self._sources = server, sources
        self._correction = Correction(sources.body)
        self._selected: Part | None = None
        self._camera: str | None = None
        self._inbox = inbox = Inbox()
        gui, motion, body_path = server.gui, sources.motion, self._body_file.path
        self._scene = Scene(
            server,
            sources.body,
            sources.reference_map,
            motion,
            lambda part: inbox.put(lambda: self._select(part)),
            sources.stations,
            surface_reader(sources.body, body_path, sources.surface),
        )
        self._time = TimePanel(gui, inbox, motion, self._show_state)
        self._parts = {str(part): part for part in self._correction.parts()}
        self._editor = Editor(
            server,
            inbox,
            "Correct",
            "Choose a part, or click a camera or joint, and drag its arrows.",
            (_NO_PART, *self._parts),
            body_path.name,
            select=lambda name: self._select(self._parts.get(name)),
            move_to=self._move_to,
            undo=lambda: self._change(self._correction.undone()),
            write=self._write,
        )
        self._footage = None if sources.recording is None else Footage(sources.recording, sources.solved)
        self._curves = CurvePanel(gui, inbox, motion) if len(motion.stamps_ns) > 1 else None
        self._picture = PicturePanel(gui, inbox, sources.cameras, self._choose_camera)
        add_switches(gui, inbox, self._scene.layers, self._scene.show_layer, has_registrations=bool(motion.registered))
        self._choose_camera(next(iter(sources.cameras), None))
        self._show_correction()
        self._scene.frame_body()

    def step(self) -> None:
        """Do what a person asks for next, or show the next picture of a recording that is being played."""
        action = self._inbox.take(_FRAME_S if self._time.is_playing else None)
        if action is not None:
            action()
        if self._time.is_playing:
            self._time.advance()

    @property
    def unwritten(self) -> str:
        """The body's file, and parts that are corrected but not in it yet."""
        parts = ", ".join(str(part) for part, _ in self._correction.moves())
        return parts and f"{self._body_file.path}: {parts}"

    @property
    def _index(self) -> int:
        return self._sources.motion.state_at(self._time.seconds)

    def _show_state(self) -> None:
        """Show the body at the time of the slider."""
        self._scene.show(self._index, follow=self._time.follows)
        if self._curves is not None:
            self._curves.show(self._time.seconds)
        self._show_picture()

    def _show_picture(self) -> None:
        """Show the image of the chosen camera at the time of the slider."""
        picture = self._scene.show_picture(self._camera, self._footage)
        self._picture.show(None if picture is None else picture.pixels, self._remark(picture))

    def _remark(self, picture: CameraPicture | None) -> str:
        """How well the body explains the image of the chosen camera."""
        remarks = []
        if self._camera is not None and self._camera in self._sources.motion.registered:
            remarks.append(self._gap(self._camera))
        if picture is not None and np.isfinite(picture.error_px):
            remarks.append(f"landmarks: {picture.error_px:.1f} px off (median)")
        if picture is None and self._camera is not None and self._footage is not None:
            remarks.append("no image at this time")
        return "\n\n".join(remarks)

    def _gap(self, camera: str) -> str:
        """How far the registered pose of a camera is from its pose on the body."""
        world_T_registered = self._sources.motion.registered_at(camera, self._index)
        if world_T_registered is None:
            return "lost: not registered"
        gap = inverse(self._scene.world_T_camera(camera)) @ world_T_registered
        distance_mm, angle = 1e3 * np.linalg.norm(gap[:3, 3]), np.degrees(np.linalg.norm(log_so3(gap[:3, :3])))
        return f"registered pose: {distance_mm:.1f} mm, {angle:.2f} deg off"

    def _choose_camera(self, camera: str | None) -> None:
        self._camera = camera
        self._picture.choose(camera)
        self._show_picture()

    def _show_correction(self) -> None:
        """Show the body as it is corrected now."""
        self._scene.reshape(self._correction.body)
        self._show_state()
        part, body = self._selected, self._correction.body
        if part is None:
            self._editor.show(_NO_PART)
        else:
            segment, segment_T_part = place_of(body, part)
            self._editor.show(str(part), segment_name(segment), segment_T_part, can_turn=can_turn(body, part))
        moves = [f"{part}: {move}" for part, move in self._correction.moves()]
        self._editor.remark("\n\n".join(["**not written yet**", *moves]) if moves else "", can_write=bool(moves))

    def _select(self, part: Part | None) -> None:
        self._selected = part
        self._scene.select(part)
        if part is not None and part.kind == "camera" and part.name in self._sources.cameras:
            self._choose_camera(part.name)
        self._show_correction()

    def _move_to(self, segment_T_part: Array, continues: bool) -> None:
        if self._selected is not None:
            self._change(self._correction.moved_to(self._selected, segment_T_part, continues=continues))

    def _change(self, correction: Correction) -> None:
        self._correction = correction
        self._show_correction()

    def _write(self) -> None:
        self._change(Correction(self._body_file.write(self._correction)))
        self._server.notify(
            "Written", f"{self._body_file.path}; as it was first: {self._body_file.original_path.name}", "green"
        )
