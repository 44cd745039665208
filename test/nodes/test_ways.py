"""Messages come with the times at which they were sent and heard, whichever executor of rclpy calls back."""

import time
from typing import Any

import pytest


@pytest.mark.parametrize("executor_name", ["SingleThreadedExecutor", "EventsExecutor"])
def test_times_come_with_messages(graph: Any, executor_name: str) -> None:
    import rclpy
    from rclpy import executors, experimental
    from std_msgs.msg import Header

    from bodycam_ros.nodes.ways import Times, give_times

    heard: list[tuple[str, Times]] = []
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node("timed", context=context)
    executor = getattr(executors, executor_name, None) or getattr(experimental, executor_name)
    executor = executor(context=context)
    executor.add_node(node)
    give_times(node.create_subscription(Header, "timed", lambda m, times=None: heard.append((m.frame_id, times)), 1))
    publisher = node.create_publisher(Header, "timed", 1)
    before_ns, deadline_s = time.time_ns(), time.monotonic() + 20.0
    never = rclpy.task.Future()
    while not heard and time.monotonic() < deadline_s:
        publisher.publish(Header(frame_id="said"))
        executor.spin_until_future_complete(never, 0.05)
    node.destroy_node()
    rclpy.shutdown(context=context)
    text, (sent_ns, heard_ns) = heard[0]
    assert text == "said"
    assert before_ns <= sent_ns <= heard_ns <= time.time_ns()


def test_a_message_within_the_process_takes_no_time() -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed; 'make test' installs it")
    from bodycam_ros.nodes.ways import Times

    before_ns = time.time_ns()
    sent_ns, heard_ns = Times.now()
    assert before_ns <= sent_ns == heard_ns <= time.time_ns()
