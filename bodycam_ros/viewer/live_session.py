"""The view of the running graph: the same scene, at the state that was published last."""

import time

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.limb_mesh import capsule_surfaces
from bodycam_ros.files.shown import markdown_text
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.viewer.motion import Motion
from bodycam_ros.viewer.panels import add_switches
from bodycam_ros.viewer.scene import Scene
from bodycam_ros.viewer.server import LocalServer, Page

_REPORT_S = 0.5
"""Between two counts of the states received."""

_SILENT_S = 2.0


class LiveSession(Page):
    """The page of a graph. ``put_body`` and ``put_state`` may be called on any thread.

    Attributes:
        text: state of the graph, in words.
    """

    def __init__(self, server: LocalServer, reference_map: ReferenceMap | None) -> None:
        super().__init__(server)
        self._map = reference_map
        self._body: BodyModel | None = None
        self._scene: Scene | None = None
        self._count = 0
        self._since = time.monotonic()
        self._last = float("-inf")
        self._is_framed = False
        self.text = "waiting for /robot_description: is the graph running, on the same ROS_DOMAIN_ID?"
        self._remark = server.gui.add_markdown(markdown_text(self.text))
        self._follow = server.gui.add_checkbox("follow the body", True)

    def put_body(self, body: BodyModel | str) -> None:
        """Show the body that the graph describes, or the reason why there is none."""
        self.server.put(lambda: self._take_body(body), "body")

    def put_state(self, body: BodyModel, state: Motion) -> None:
        """Show a state of the body that the graph described last; of several in the queue only the last."""
        self._count += 1
        self.server.put(lambda: self._show(body, state), "state")

    def step(self, timeout_s: float = _REPORT_S) -> None:
        """Do the next action, or wait for it up to a time."""
        self.server.act(timeout_s)
        now = time.monotonic()
        if now - self._since < _REPORT_S:
            return
        rate, self._count = self._count / (now - self._since), 0
        self._since = now
        if self._scene is not None:
            is_silent = now - self._last >= _SILENT_S
            self.text = "no state of the body is published" if is_silent else f"{rate:.0f} states a second"
        self._remark.content = markdown_text(self.text)

    def _take_body(self, body: BodyModel | str) -> None:
        if isinstance(body, str):
            self.text = body
            return
        before, self._body = self._body, body
        shown = self._scene
        if shown is not None and before is not None and _parts(body) == _parts(before):
            shown.reshape(body)
            return
        self.server.scene.reset()
        self._scene = scene = Scene(
            self.server, body, self._map, Motion.standing(body), lambda part: None, read_surfaces=capsule_surfaces
        )
        if shown is None:
            add_switches(self.server, scene.layers, self._switch, has_registrations=True)
        else:
            for layer, visible in shown.layers.items():
                scene.show_layer(layer, visible)
        self._is_framed = False
        self.text = "waiting for /joint_states and /odometry"

    def _show(self, body: BodyModel, state: Motion) -> None:
        if self._scene is None or body is not self._body:
            return
        self._last = time.monotonic()
        self._scene.motion = state
        self._scene.show(0, follow=bool(self._follow.value))
        if not self._is_framed:
            self._scene.frame_body()
            self._is_framed = True

    def _switch(self, layer: str, visible: bool) -> None:
        assert self._scene is not None
        self._scene.show_layer(layer, visible)


def _parts(body: BodyModel) -> tuple[object, ...]:
    """What a scene is built for; lengths and mounts can change later."""
    return body.segments, tuple((joint.name, joint.parent, joint.child) for joint in body.joints), tuple(body.mounts)
