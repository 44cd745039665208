"""Quality of service of the graph's topics (DESIGN 3: reliable, for a lost track message is lost for good).

A reader's depth bounds how far its node may fall behind before it loses messages; a writer's, how far behind its
slowest reader may be.
"""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

STAGE_DEPTH = 1000
"""Between stages: 33 s of one camera at 30 Hz, 10 MB. The registration of 16 cameras bears long bursts with it."""

OUTPUT_DEPTH = 200
"""Of what the solver publishes: a flush sends a whole window at once."""


def reliable(depth: int) -> QoSProfile:
    """Reliable delivery to those that listen by now."""
    return QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=depth, reliability=ReliabilityPolicy.RELIABLE)


def best_effort(depth: int) -> QoSProfile:
    """What a camera driver that offers no more can be read with."""
    return QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)


def sensor_data(depth: int) -> QoSProfile:
    """What a camera driver publishes, as reliably as it offers that: who reads adapts (``Overridable.resolved``)."""
    return QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=depth, reliability=ReliabilityPolicy.BEST_AVAILABLE)


def camera_info(depth: int) -> QoSProfile:
    """The same of what some drivers say once and keep."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.BEST_AVAILABLE,
        durability=DurabilityPolicy.BEST_AVAILABLE,
    )


def latched(depth: int = 1) -> QoSProfile:
    """The latest messages also reach those that come later."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )
