"""The view: what it shows, and what happens when a person uses it."""

import time
from pathlib import Path
from typing import Literal

import numpy as np

from bodycam_ros.errors import BodycamError
from bodycam_ros.geometry import inverse, log_so3
from bodycam_ros.terminal import Terminal
from bodycam_ros.viewer.camera_scene import CameraPicture, PicturePanel, load_bands
from bodycam_ros.viewer.correction import Correction, Gizmo, Move, Part, can_turn, place_of
from bodycam_ros.viewer.footage import FINE, Detail, FootageLoader
from bodycam_ros.viewer.inbox import Inbox
from bodycam_ros.viewer.panels import (
    CorrectionActions,
    CorrectionPanel,
    CurvePanel,
    Keys,
    Playback,
    ShowPanel,
    TimePanel,
)
from bodycam_ros.viewer.scene import Scene
from bodycam_ros.viewer.sources import LocalServer, Sources
from bodycam_ros.viewer.surface_scene import surface_reader

_FRAME_S = 1.0 / 30.0
"""Between two pictures of a recording that is being played."""

_NOTICE_S = 6.0
_NAMES = "names"
_STILL = 1e-9  # [m], and of a rotation matrix: a gizmo that is taken without being moved
_GREEN: Literal["green"] = "green"
_RED: Literal["red"] = "red"


def view(
    solved: Path | None,
    map_path: Path | None,
    body_path: Path,
    recording: Path | None,
    port: int,
    stations: Path | None = None,
    surface: Path | None = None,
    compare: Path | None = None,
    detail: Detail = FINE,
) -> None:
    """Show a body in a browser until the program is interrupted.

    Args:
        solved: bag that ``bodycam replay`` wrote; None: the body in its N-pose.
        map_path: map folder; None where stations are given, whose own frame then is the world.
        body_path: body file, written back when a person asks for it.
        recording: bag that ``solved`` was made from.
        port: of this machine; 0 takes any free one.
        stations: file that says where static cameras stand.
        surface: folder of the body's meshes; None for the body's own, or capsules.
        compare: another bag that was solved from the same recording.
        detail: how finely it is drawn.

    Raises:
        BodycamError: an input is missing or damaged, they do not fit each other, or the port cannot be used.
    """
    sources = Sources.read(solved, map_path, body_path, recording, stations, surface, compare)
    server = LocalServer(port, f"bodycam view: {sources.body.name}")
    try:
        session = Session(server, sources, detail)
        Terminal().print(f"open {server.address}{detail.page} in a browser; Ctrl-C ends it", soft_wrap=True)
        try:
            session.run()
        finally:
            if session.unwritten:
                lost = f"bodycam: not written to {body_path}: {', '.join(session.unwritten)}"
                Terminal(stderr=True).print(lost, soft_wrap=True)
    finally:
        server.stop()


class Session:
    """One view. All of it is done in the thread that calls ``run``."""

    def __init__(self, server: LocalServer, sources: Sources, detail: Detail = FINE) -> None:
        self._server = server
        self._sources = sources
        self._correction = Correction(sources.body)
        self._selected: Part | None = None
        self._goes_on = False
        self._camera: str | None = None
        self._inbox = inbox = Inbox()
        duration_s = float(sources.motion.seconds[-1])
        self._playback = Playback(duration_s, time.monotonic)
        scene, gui = server.scene, server.gui
        self._scene = Scene(
            server,
            sources.body,
            sources.reference_map,
            sources.motion,
            self._click,
            sources.stations,
            surface_reader(sources.body, sources.body_file.path, sources.surface),
            sources.other,
            detail,
        )
        self._gizmo = Gizmo(scene, lambda: inbox.put(self._grab), lambda: inbox.put(self._drag, "drag"))
        self._time = TimePanel(gui, inbox, self._playback, duration_s, self._show_instant, self._show_instant)
        if duration_s > 0.0:
            Keys(gui, inbox, self._time.play_or_pause, self._step, self._go)
        actions = CorrectionActions(self._select, self._enter, self._undo, self._reset, self._write)
        self._panel = CorrectionPanel(gui, inbox, self._correction.parts(), sources.body_file.path.name, actions)
        self._loader: FootageLoader | None = None
        if sources.recording is not None:
            self._loader = FootageLoader(sources.recording, sources.solved, inbox, self._show_picture, self._complain)
        self._curves = CurvePanel(gui, inbox, sources.motion, sources.other) if duration_s > 0.0 else None
        if self._curves is not None and sources.solved is not None:
            first_ns = int(sources.motion.stamps_ns[0])
            mounts = tuple(sources.body.mounts)
            load_bands(sources.solved, first_ns, mounts, inbox, self._curves.show_bands, self._complain)
        self._picture = PicturePanel(gui, inbox, sources.cameras, self._choose_camera)
        self._show_surface(True)
        switches = {"cameras": self._scene.show_cameras, "surface": self._show_surface, _NAMES: self._scene.show_names}
        if sources.reference_map is not None:
            switches = {"map": self._scene.show_map, **switches}
        if sources.other is not None:
            switches[sources.other.path.name] = self._show_other
        ShowPanel(gui, inbox, switches, {_NAMES}, knows_registration=bool(sources.motion.registered))
        self._choose_camera(next(iter(sources.cameras), None))
        self._show_correction()
        self._scene.look_at_body(sources.body, 0)

    def run(self) -> None:
        """Do what people ask for, for ever."""
        while True:
            action = self._inbox.take(_FRAME_S if self._playback.is_playing else None)
            try:
                if action is not None:
                    action()
                if self._playback.is_playing:
                    self._time.show(self._playback.advance(self._time.seconds))
                    self._show_instant()
            except BodycamError as error:
                self._complain(error)

    @property
    def unwritten(self) -> list[str]:
        """Parts that are corrected but not in the file yet."""
        return [str(part) for part, _ in self._correction.moves()]

    @property
    def _instant(self) -> int:
        return self._sources.motion.instant_at(self._time.seconds)

    @property
    def _last(self) -> int:
        return len(self._sources.motion.stamps_ns) - 1

    def _show_instant(self) -> None:
        """Show the body at the time of the slider."""
        self._scene.show(self._correction.body, self._instant, follow=self._time.follows)
        if self._curves is not None:
            self._curves.show(self._time.seconds, self._apart())
        self._show_picture()

    def _step(self, instants: int) -> None:
        """Go so many instants on, or back, and hold time there."""
        self._go(float(self._sources.motion.seconds[np.clip(self._instant + instants, 0, self._last)]))

    def _go(self, seconds: float) -> None:
        """Go to a time, and hold it there."""
        if self._playback.is_playing:
            self._time.play_or_pause()
        self._time.show(min(seconds, float(self._sources.motion.seconds[-1])))
        self._show_instant()

    def _show_other(self, visible: bool) -> None:
        self._scene.show_other(self._correction.body, self._instant, visible)

    def _apart(self) -> str:
        """How far the joints are from where the recording that is compared with has them."""
        motion, other = self._sources.motion, self._sources.other
        if other is None:
            return ""
        body = self._correction.body
        poses = motion.segments_at(body, self._instant)
        places = dict(zip(body.segments, poses[:, :3, 3], strict=True))
        apart = other.apart_m(places, int(motion.stamps_ns[self._instant]), motion.frame_ns // 2)
        if not len(apart):
            return f"{other.path.name} knows nothing at this time"
        median_mm, most_mm = 1e3 * float(np.median(apart)), 1e3 * float(apart.max())
        return f"dashed: {other.path.name}; joints {median_mm:.1f} mm apart (median), {most_mm:.1f} mm at most"

    def _show_surface(self, visible: bool) -> None:
        self._scene.show_surface(self._correction.body, visible)

    def _show_picture(self) -> None:
        """Show what the chosen camera saw at that time."""
        footage = None if self._loader is None else self._loader.footage
        picture = self._scene.show_picture(self._correction.body, self._instant, self._camera, footage)
        self._picture.show(None if picture is None else picture.pixels, self._remark(picture))

    def _show_correction(self) -> None:
        """Show the body as it is corrected now."""
        self._scene.reshape(self._correction.body)
        self._show_instant()
        move = None if self._selected is None else self._correction.move_of(self._selected)
        turns = can_turn(self._correction.body, self._selected)
        self._panel.show(move, self._correction.moves(), can_turn=turns)

    def _remark(self, picture: CameraPicture | None) -> str:
        """How well the body explains what the chosen camera saw."""
        remarks = []
        if self._camera is not None and self._camera in self._sources.motion.registered:
            remarks.append(self._gap(self._camera))
        if picture is not None and np.isfinite(picture.error_px):
            remarks.append(f"landmarks: {picture.error_px:.1f} px off (median)")
        if picture is None and self._camera is not None and self._loader is not None:
            remarks.append("reading the recording" if self._loader.footage is None else "no image at this time")
        return "\n\n".join(remarks)

    def _gap(self, camera: str) -> str:
        """How far the camera's own pose is from where the body puts it."""
        world_T_registered = self._sources.motion.registered_at(camera, self._instant)
        if world_T_registered is None:
            return "lost: it does not know where it is"
        gap = inverse(self._scene.world_T_camera(self._correction.body, self._instant, camera)) @ world_T_registered
        distance_mm, angle = 1e3 * np.linalg.norm(gap[:3, 3]), np.degrees(np.linalg.norm(log_so3(gap[:3, :3])))
        return f"its own pose: {distance_mm:.1f} mm, {angle:.2f} deg off"

    def _choose_camera(self, camera: str | None) -> None:
        self._camera = camera
        self._picture.choose(camera)
        if self._loader is not None:
            self._loader.ask(camera)
        self._show_picture()

    def _click(self, part: Part) -> None:
        """A part was clicked, on one of the server's threads."""
        self._inbox.put(lambda: self._select(part))

    def _select(self, part: Part | None) -> None:
        self._selected = part
        self._goes_on = False
        self._panel.select(part)
        self._gizmo.select(self._correction.body, part)
        self._scene.select(self._correction.body, part)
        if part is not None and part.kind == "camera" and part.name in self._sources.cameras:
            self._choose_camera(part.name)
        self._show_correction()

    def _grab(self) -> None:
        """The gizmo was taken or let go: what follows is a step of its own."""
        self._goes_on = False

    def _drag(self) -> None:
        if self._selected is None:
            return
        place = self._gizmo.segment_T_part
        if np.allclose(place, place_of(self._correction.body, self._selected)[1], rtol=0.0, atol=_STILL):
            return
        self._correction = self._correction.moved_to(self._selected, place, going_on=self._goes_on)
        self._goes_on = True
        self._show_correction()

    def _enter(self, move: Move) -> None:
        # A field that is left says its number again.
        if self._selected is not None and not move.looks_like(self._correction.move_of(self._selected)):
            self._change(self._correction.moved_by(self._selected, move))

    def _undo(self) -> None:
        self._change(self._correction.undone())

    def _reset(self) -> None:
        if self._selected is not None:
            self._change(self._correction.reset(self._selected))

    def _change(self, correction: Correction) -> None:
        """Take over a correction that was not made with the gizmo."""
        self._correction = correction
        self._goes_on = False
        if self._selected is not None:
            self._gizmo.follow(correction.body, self._selected)
        self._show_correction()

    def _write(self) -> None:
        body_file = self._sources.body_file
        self._change(Correction(body_file.write(self._correction)))
        self._notify("Written", f"{body_file.path}; as it was first: {body_file.original_path.name}", _GREEN)

    def _complain(self, error: BodycamError) -> None:
        self._notify("This did not work", str(error), _RED)

    def _notify(self, title: str, text: str, colour: Literal["green", "red"]) -> None:
        seconds = None if colour == _RED else _NOTICE_S
        for client in self._server.get_clients().values():
            client.add_notification(title, text, auto_close_seconds=seconds, color=colour)
