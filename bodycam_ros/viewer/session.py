"""The view of a solved recording: what happens when a person uses it."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from bodycam_ros.files.shown import markdown_text
from bodycam_ros.geometry import inverse, log_so3
from bodycam_ros.results.camera_picture import CameraPicture
from bodycam_ros.results.footage import Footage
from bodycam_ros.viewer.correction import Correction, Part, can_turn, place_of
from bodycam_ros.viewer.editor import Editor
from bodycam_ros.viewer.panels import CurvePanel, PicturePanel, TimePanel, add_switches
from bodycam_ros.viewer.scene import Scene, segment_name, surface_reader
from bodycam_ros.viewer.server import LocalServer, Page
from bodycam_ros.viewer.sources import Sources
from bodycam_ros.viewer.strip import Strip
from bodycam_ros.viewer.trail import Trail

_FRAME_S = 1.0 / 30.0
"""Between two pictures of a recording that is being played."""

_REST_S = 0.25
"""After which nobody moves the time: then the images of all cameras are read."""

_NO_PART = "nothing"


class Session(Page):
    """The page of one body."""

    def __init__(self, server: LocalServer, sources: Sources) -> None:
        """Show what is read; corrections can be written where the body is from a file.

        Raises:
            BodyError: the surface cannot be used.
        """
        super().__init__(server)
        self._body_file = sources.body_file
        self._sources = sources
        motion = sources.motion
        self._selected: Part | None = None
        self._camera: str | None = None
        if self._body_file is None:  # beside which the meshes would be that the body names
            surfaces = surface_reader(replace(sources.body, surface=None), Path(), sources.surface)
        else:
            surfaces = surface_reader(sources.body, self._body_file.path, sources.surface)
        self._scene = Scene(
            server, sources.body, sources.reference_map, motion, self._select, sources.stations, surfaces
        )
        self._time = TimePanel(server, motion, self._show_state)
        correction = Correction(sources.body, sources.body)
        self._editor = Editor(
            server,
            "Correct",
            "Choose a part, or click a camera or joint, and drag its arrows.",
            {_NO_PART: None} | {str(part): part for part in correction.parts()},
            correction,
            self._body_file.path.name if self._body_file else "(needs --body)",
            select=self._select,
            changed=self._show_correction,
            write=self._write,
        )
        self._footage = None if sources.recording is None else Footage(sources.recording, sources.solved)
        self._curves = CurvePanel(server, motion) if len(motion.stamps_ns) > 1 else None
        self._picture = PicturePanel(server, sources.cameras, self._choose_camera)
        self._strip = None
        if self._footage is not None and self._curves is not None:
            self._strip = Strip(server, sources.cameras, self._footage, motion, self._curves.panel)
        self._trail = Trail(server, motion, sources.body, self._show_state) if len(motion.stamps_ns) > 1 else None
        add_switches(server, self._scene.layers, self._scene.show_layer, has_registrations=bool(motion.registered))
        self._choose_camera(next(iter(sources.cameras), None))
        self._show_correction()
        self._scene.frame_body()

    def step(self) -> None:
        """Do what a person asks for next, or show the next picture of a recording that is being played."""
        if self._time.is_playing:
            self.server.act(_FRAME_S)
            self._time.advance()
        elif self._strip is None or not self._strip.is_due:
            self.server.act()
        elif not self.server.act(0.0 if self._strip.is_begun else _REST_S):
            self._strip.read_next()

    @property
    def unwritten(self) -> str:
        """The body's file, and parts that are corrected but not in it yet."""
        parts = ", ".join(str(part) for part, _ in self._editor.edited.moves())
        return f"{self._body_file.path}: {parts}" if parts and self._body_file else ""

    @property
    def _index(self) -> int:
        return self._sources.motion.state_at(self._time.seconds)

    def _show_state(self) -> None:
        """Show the body at the time of the slider."""
        self._scene.show(self._index, follow=self._time.follows)
        if self._curves is not None:
            self._curves.show(self._time.seconds)
        if self._trail is not None:
            self._trail.show(self._index)
        if self._strip is not None:
            self._strip.show(self._index)
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
            return "not registered at this time"
        gap = inverse(self._scene.world_T_camera(camera)) @ world_T_registered
        distance_mm, angle = 1e3 * np.linalg.norm(gap[:3, 3]), np.degrees(np.linalg.norm(log_so3(gap[:3, :3])))
        return f"registered pose: {distance_mm:.1f} mm, {angle:.2f} deg off"

    def _choose_camera(self, camera: str | None) -> None:
        self._camera = camera
        self._picture.choose(camera)
        self._show_picture()

    def _show_correction(self) -> None:
        """Show the body as it is corrected now."""
        correction, part = self._editor.edited, self._selected
        self._scene.reshape(correction.body)
        if self._trail is not None:
            self._trail.reshape(correction.body)
        self._show_state()
        if part is None:
            self._editor.show(_NO_PART)
        else:
            segment, segment_T_part = place_of(correction.body, part)
            can_turn_part = can_turn(correction.body, part)
            self._editor.show(str(part), segment_name(segment), segment_T_part, can_turn=can_turn_part)
        moves = [markdown_text(f"{part}: {move}") for part, move in correction.moves()]
        can_write = bool(moves and self._body_file)
        self._editor.remark("\n\n".join(["**not written yet**", *moves]) if moves else "", can_write=can_write)

    def _select(self, part: Part | None) -> None:
        self._selected = part
        self._scene.select(part)
        if part is not None and part.kind == "camera" and part.name in self._sources.cameras:
            self._choose_camera(part.name)
        self._show_correction()

    def _write(self) -> None:
        file = self._body_file
        assert file is not None
        written = file.write(self._editor.edited)
        self._editor.restart(Correction(written, written))
        self.server.notify("Written", f"{file.path}; as it was first: {file.original_path.name}", "green")
