"""What the body tells the registrations: where lost cameras should be, and whose registration it contradicts."""

from collections.abc import Iterable
from typing import Any

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.messages.header import MAP_FRAME, header_message
from bodycam_ros.messages.pose import stamped_pose_message
from bodycam_ros.nodes.qos import reliable
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.pipeline import SkeletonPipeline
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.solving.body_state import BodyState
from bodycam_ros.solving.expected_cameras import ExpectedCameras


class BodyHints:
    """Publishers of ``<camera>/expected_pose`` and ``<camera>/doubt``, with stamps of the camera's own clock.

    Args:
        node: publishes.
        cameras: names.
    """

    def __init__(self, node: StageNode[Any], cameras: Iterable[str]) -> None:
        self._make = node.make
        self._expected: ExpectedCameras | None = None
        self._doubted_ns: dict[str, int] = {}
        self._poses, self._doubts = (
            {camera: node.publisher(kind, f"{camera}/{topic}", reliable(1)) for camera in cameras}
            for kind, topic in (
                ("geometry_msgs/msg/PoseWithCovarianceStamped", "expected_pose"),
                ("std_msgs/msg/Header", "doubt"),
            )
        )

    def begin(self, body: BodyModel) -> None:
        """There is a body, or another one."""
        self._expected = ExpectedCameras(body)
        self._doubted_ns.clear()

    def hear(self, matches: LandmarkMatches) -> None:
        """What a camera says, in order of time."""
        if self._expected is not None:
            self._expected.hear(matches)

    def tell(self, state: BodyState, pipeline: SkeletonPipeline) -> None:
        """Where the lost cameras are by the latest instant, and who has been contradicted for a while."""
        clocks = pipeline.instants.watch.clocks
        for expected in self._expected.of(state, clocks) if self._expected is not None else ():
            message = stamped_pose_message(self._make, expected.stamp_ns, expected.world_T_camera, expected.covariance)
            self._poses[expected.camera].publish(message)
        for camera, refusal in pipeline.doubted.items():
            stamp_ns = refusal.until_ns
            if stamp_ns != self._doubted_ns.get(camera):
                self._doubted_ns[camera] = stamp_ns
                own_ns = stamp_ns + (clocks[camera].offset_ns(stamp_ns) if camera in clocks else 0)
                self._doubts[camera].publish(header_message(self._make, own_ns, MAP_FRAME))
