"""Says or hears messages of two sizes, as a tracker's are: a process of its own, ``say COUNT`` or ``hear COUNT``.

Who hears prints a line of JSON: kind -> how late each message was [s], in the order in which they came.
"""

import json
import sys
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import CompressedImage

from bodycam_ros.nodes.ways import Times, give_times

KINDS = {"tracks": 2_600, "keyframe": 40_000}
"""Name -> bytes; every tenth message is a keyframe."""

QUALITY = QoSProfile(depth=1000)
HZ, GIVE_UP_S = 30.0, 30.0


def is_keyframe(number: int) -> bool:
    return number % 10 == 0


def say(node: Node, count: int) -> None:
    publishers = {kind: node.create_publisher(CompressedImage, kind, QUALITY) for kind in KINDS}
    while not all(publisher.get_subscription_count() for publisher in publishers.values()):
        time.sleep(0.05)
    # They know of us when we know of them, but for what is under way.
    time.sleep(1.0)
    for number in range(count):
        kind = "keyframe" if is_keyframe(number) else "tracks"
        publishers[kind].publish(CompressedImage(data=bytes(KINDS[kind])))
        time.sleep(1.0 / HZ)
    deadline_s = time.monotonic() + GIVE_UP_S
    while any(publisher.get_subscription_count() for publisher in publishers.values()):
        if time.monotonic() > deadline_s:
            return
        time.sleep(0.05)


def hear(node: Node, count: int) -> None:
    late_s: dict[str, list[float]] = {kind: [] for kind in KINDS}

    def on(kind: str, times: Times) -> None:
        assert times is not None
        late_s[kind].append(1e-9 * (times.heard_ns - times.sent_ns))

    for kind in KINDS:
        heard = node.create_subscription(CompressedImage, kind, lambda _, times=None, k=kind: on(k, times), QUALITY)
        give_times(heard)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    deadline_s = time.monotonic() + GIVE_UP_S
    while sum(map(len, late_s.values())) < count and time.monotonic() < deadline_s:
        executor.spin_once(0.1)
    print(json.dumps(late_s))


if __name__ == "__main__":
    rclpy.init()
    what, how_many = sys.argv[1:]
    {"say": say, "hear": hear}[what](rclpy.create_node(what), int(how_many))
