"""A person places a body over the first images of static cameras: the start of a solve by these cameras alone."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from bodycam_ros.body.body_edit import joint_named
from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras.placement import Placement
from bodycam_ros.static_cameras.segment_support import CONFIRMED
from bodycam_ros.viewer.correction import Part
from bodycam_ros.viewer.editor import Editor
from bodycam_ros.viewer.inbox import Inbox
from bodycam_ros.viewer.motion import Motion
from bodycam_ros.viewer.placing_picture import PlacingPicture
from bodycam_ros.viewer.placing_sources import PlacingSources
from bodycam_ros.viewer.scene import WORLD, Scene
from bodycam_ros.viewer.server import LocalServer

_PICTURE_PANEL_PX = 600
_POSSIBLE = 0.48  # support of a segment that may be where it is; those that were off by 15 cm had less

_HELP = "Place the pelvis first, then head, hands and feet, then knees and elbows. Drag the handles. Then fit."


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
        self._pictures = PlacingPicture(body, sources.tracker.views, sources.images)
        self._add_panels()
        self._select(body.root)
        self._scene.frame_body()

    def _add_panels(self) -> None:
        gui, inbox, body = self._server.gui, self._inbox, self._placement.body
        panel = gui.add_panel()
        with panel.add_tab("First images"):
            close_up = gui.add_checkbox("close up", False)
            self._image = gui.add_image(self._pictures.draw(self._placement.poses, body.root), format="jpeg")
        panel.dock_left()
        panel.set_width(_PICTURE_PANEL_PX)
        self._editor = Editor(
            self._server,
            inbox,
            "Place",
            _HELP,
            body.segments,
            self._output.name,
            select=self._select,
            move_to=self._move_to,
            undo=lambda: self._change(self._placement.undone()),
            write=self._write,
        )
        with self._editor.folder:
            inbox.on_click(gui.add_button("Fit"), self._fit)
        inbox.on_input(close_up, self._cut)

    def step(self) -> None:
        """Do what a person asks for next, or wait for it."""
        if action := self._inbox.take(None):
            action()

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

    def _show(self) -> None:
        """Show the body where it is now."""
        self._scene.pose(self._placement.poses)
        self._image.image = self._pictures.draw(self._placement.poses, self._selected)
        pose, can_move = self._placement.pose_of(self._selected), self._placement.can_move(self._selected)
        self._editor.show(self._selected, WORLD, pose, can_move=can_move)

    def _move_to(self, world_T_segment: Array, continues: bool) -> None:
        self._change(self._placement.moved_to(self._selected, world_T_segment, continues=continues))

    def _change(self, placement: Placement) -> None:
        self._placement = placement
        self._editor.remark("")
        self._show()

    def _fit(self) -> None:
        self._editor.remark("fitting")
        poses, support = self._sources.fit(self._placement.poses)
        self._change(self._placement.changed(poses))
        segments = self._placement.body.segments
        self._editor.remark(support_table(dict(zip(segments, support.tolist(), strict=True))))

    def _write(self) -> None:
        self._sources.write(self._output, self._placement.poses)
        self._written = self._placement.poses
        self._server.notify("Written", f"{self._output}; replay with --start {self._output}", "green")

    def _cut(self, is_close_up: bool) -> None:
        self._pictures.cut(is_close_up)
        self._show()


def support_table(support: Mapping[str, float]) -> str:
    """Markdown of how well the images support each segment where it is, the least first; NaN: they do not show it."""
    lines = ["| segment | is in the images |", "|---|---|"]
    for segment, share in sorted(support.items(), key=lambda item: (np.isnan(item[1]), item[1])):
        word = "yes" if share >= CONFIRMED else "perhaps" if share >= _POSSIBLE else "**no: move it**"
        word = "hidden" if np.isnan(share) else f"{word} ({share:.2f})"
        lines.append(f"| {segment.replace('_', ' ')} | {word} |")
    return "\n".join(lines)
