"""Static cameras as the solver meets them live: what they say of the body, and where it tells them that the body is."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyNow, SaidSegments
from bodycam_ros.live.node_parameters import SolverParameters
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.segment_poses import (
    SEGMENT_POSES,
    SEGMENT_POSES_TYPE,
    SEGMENTS_NOW,
    SEGMENTS_NOW_TYPE,
    segment_poses,
    segments_now_message,
)
from bodycam_ros.nodes.parameters import STAGE_DEPTH, latched, reliable
from bodycam_ros.nodes.stage_node import Stage
from bodycam_ros.static_cameras.station import Station


class Stations:
    """Receives what static cameras see of the body, and publishes where it is for them.

    Args:
        stage: the solver.
        stations: by name.
        on_said: called with what a station has seen.

    Attributes:
        stations: by name.
    """

    def __init__(
        self,
        stage: Stage[SolverParameters],
        stations: Mapping[str, Station],
        on_said: Callable[[SaidSegments], None],
    ) -> None:
        self._stage, self.stations, self._on_said = stage, stations, on_said
        self._told_ns: int | None = None
        # Who starts again must hear both instants.
        self._now = stage.publisher(SEGMENTS_NOW_TYPE, SEGMENTS_NOW, latched(2))
        for station in stations:
            topic = f"{station}{SEGMENT_POSES}"
            stage.subscription(SEGMENT_POSES_TYPE, topic, partial(self._hear, station), reliable(STAGE_DEPTH))

    def publish(self, lately: Sequence[BodyNow], body: BodyModel) -> None:
        """Where the body is at the latest instant, once; and at the one before, of which more is known by now.

        What a limb did in between is its velocity. What was said at the time would not do: that the body is found to be
        elsewhere than it was expected is no motion.
        """
        if lately and lately[-1].stamp_ns != self._told_ns:
            self._told_ns = lately[-1].stamp_ns
            for now in lately:
                self._now.publish(segments_now_message(self._stage.make, now, body))

    def _hear(self, station: str, message: Message) -> None:
        try:
            said = segment_poses(message)
            if said.station != station:
                raise ValueError(f"it is from {said.station}")
        except ValueError as error:
            reason = f"{station}{SEGMENT_POSES}: malformed message ({error})"
            self._stage.skipped.add("stations' words skipped", reason)
            return
        self._on_said(said)
