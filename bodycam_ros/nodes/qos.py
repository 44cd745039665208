"""Quality of service of the graph's topics (DESIGN 3: reliable, for a lost track message is lost for good).

A reader's depth bounds how far its node may fall behind before it loses messages; a writer's, how far behind its
slowest reader may be.
"""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

STAGE_DEPTH = 1000
"""Between stages: 33 s of one camera at 30 Hz, 10 MB. The registration of 16 cameras bears long bursts with it."""

OUTPUT_DEPTH = 200
"""Of what the solver publishes: a flush sends a whole window at once."""


def reliable(depth: int) -> QoSProfile:
    """Reliable delivery to the subscriptions that are there."""
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE)


def best_effort(depth: int) -> QoSProfile:
    """What every driver's publisher fits."""
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)


def latched(depth: int = 1) -> QoSProfile:
    """The latest messages also reach those that come later."""
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
