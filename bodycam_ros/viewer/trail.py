"""The way of one joint before and after the time shown, as a line in the scene."""

import numpy as np

from bodycam_ros.body.body_edit import joint_named
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, transform_points
from bodycam_ros.results.colours import rgb, side_colour
from bodycam_ros.results.solved_body import GAP_FRAMES
from bodycam_ros.viewer.motion import Motion
from bodycam_ros.viewer.scene import WORLD
from bodycam_ros.viewer.server import Action, LocalServer

_NO_JOINT = "none"
_SECONDS, _MOST_S = 1.0, 60.0
_PIECES = 600  # drawn at most
_LINE_PX = 4.0
_PALE = 0.25  # share of white in what is still to come
_GAMMA = 2.2  # the page takes colours of single pieces for linear light


class Trail:
    """A list of joints, a number of seconds, and the line of the chosen joint."""

    def __init__(self, server: LocalServer, motion: Motion, body: BodyModel, on_change: Action) -> None:
        self._server, self._motion, self._body = server, motion, body
        self._way = np.zeros((0, 3))
        with server.gui.add_folder("Trail"):
            self._joint = server.gui.add_dropdown("trail of", (_NO_JOINT, *(joint.name for joint in body.joints)))
            self._seconds = server.gui.add_number("± seconds", _SECONDS, min=0.0, max=_MOST_S, step=0.1)
        self._line = server.scene.add_line_segments(
            f"{WORLD}/trail",
            np.zeros((1, 2, 3), np.float32),
            np.zeros((1, 2, 3), np.uint8),
            thickness=_LINE_PX,
            thickness_units="screen",
            visible=False,
        )

        def choose(_: object) -> None:
            self._find_way()
            on_change()

        server.on_input(self._joint, choose)
        server.on_input(self._seconds, lambda _: on_change())

    def reshape(self, body: BodyModel) -> None:
        """Follow the joint on a body as it is corrected now."""
        if body is not self._body:
            self._body = body
            self._find_way()

    def show(self, index: int) -> None:
        """Show the line around one state; none without a joint, or where there is but one state."""
        lines, is_past = trail_pieces(self._way, self._motion, index, float(self._seconds.value))
        with self._server.atomic():
            self._line.visible = len(lines) > 0
            if len(lines):
                colour = np.array(rgb(side_colour(self._joint.value))) / 255.0
                shown = np.where(is_past[:, None], colour, (1.0 - _PALE) * colour + _PALE)
                colours = np.round(255.0 * shown**_GAMMA).astype(np.uint8)
                self._line.points = lines.astype(np.float32)
                self._line.colors = np.repeat(colours[:, None], 2, axis=1)

    def _find_way(self) -> None:
        joint = self._joint.value
        self._way = np.zeros((0, 3)) if joint == _NO_JOINT else way_of(self._motion, self._body, joint)


def way_of(motion: Motion, body: BodyModel, joint_name: str) -> Array:
    """(T, 3) where a joint of a body is at all states [m].

    Raises:
        BodyError: the body has no such joint.
    """
    joint = joint_named(body, joint_name)
    world_T_parent = motion.segments(body)[:, body.segment_index[joint.parent]]
    return np.asarray(transform_points(world_T_parent, joint.parent_T_joint[None, :3, 3])[:, 0])


def trail_pieces(way: Array, motion: Motion, index: int, seconds: float) -> tuple[Array, np.ndarray]:
    """Pieces (N, 2, 3) [m] of a way (T, 3) at most so many seconds from a state, and (N,) whether each is before it.

    A gap of time has no piece.
    """
    if len(way) < 2 or seconds <= 0.0:
        return np.zeros((0, 2, 3)), np.zeros(0, bool)
    at_s = motion.seconds
    first, last = np.searchsorted(at_s, [at_s[index] - seconds - 1e-9, at_s[index] + seconds + 1e-9])
    step = max(1, -(-(last - first) // _PIECES))
    # The state itself is an end of two pieces.
    before, after = np.arange(index, first - 1, -step)[::-1], np.arange(index, last, step)
    rows = np.concatenate([before, after[1:]])
    steps = np.diff(at_s[rows])
    pieces = np.stack([way[rows[:-1]], way[rows[1:]]], axis=1)
    whole = steps <= GAP_FRAMES * step * 1e-9 * motion.frame_ns
    return pieces[whole], (rows[1:] <= index)[whole]
