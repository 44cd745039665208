"""Static cameras in the solver: their measurements in, the current body out."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import LatestState, SegmentMeasurements
from bodycam_ros.live.node_parameters import SolverParameters
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.segment_poses import (
    SEGMENT_POSES,
    SEGMENT_POSES_TYPE,
    SEGMENTS_NOW,
    latest_state_message,
    segment_poses,
)
from bodycam_ros.nodes.parameters import STAGE_DEPTH, latched, reliable
from bodycam_ros.nodes.stage_node import Stage
from bodycam_ros.static_cameras.station import Station


class Stations:
    """Receives the measurements of static cameras, and publishes the current body for them.

    Args:
        stage: the solver.
        stations: by name.
        on_measured: called with the measurements of one image.
    """

    def __init__(
        self,
        stage: Stage[SolverParameters],
        stations: Mapping[str, Station],
        on_measured: Callable[[SegmentMeasurements], None],
    ) -> None:
        self._stage, self._on_measured = stage, on_measured
        self._published_ns: int | None = None
        # A node that was restarted needs both states.
        self._now = stage.publisher(SEGMENT_POSES_TYPE, SEGMENTS_NOW, latched(2))
        for station in stations:
            topic = f"{station}{SEGMENT_POSES}"
            stage.subscription(SEGMENT_POSES_TYPE, topic, partial(self._receive, station), reliable(STAGE_DEPTH))

    def publish(self, latest: Sequence[LatestState], body: BodyModel) -> None:
        """Publish the latest state once, and the one before as it is estimated by now.

        Their difference is the velocity of each limb. The earlier estimate of the state before would not do: a
        correction of the pose is no motion.
        """
        if latest and latest[-1].stamp_ns != self._published_ns:
            self._published_ns = latest[-1].stamp_ns
            for now in latest:
                self._now.publish(latest_state_message(self._stage.make, now, body))

    def _receive(self, station: str, message: Message) -> None:
        try:
            measured = segment_poses(message)
            if measured.station != station:
                raise ValueError(f"it is from {measured.station}")
        except ValueError as error:
            reason = f"{station}{SEGMENT_POSES}: malformed message ({error})"
            self._stage.dropped.add("segment poses dropped", reason)
            return
        self._on_measured(measured)
