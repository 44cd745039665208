"""Keeps the last report of every part on /diagnostics in a file until SIGINT; a process of its own."""

import json
import os
import signal
import sys
import time
from pathlib import Path

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.signals import SignalHandlerOptions

path = Path(sys.argv[1])
heard: dict[str, dict[str, str]] = {}
ended = []


def hear(message: DiagnosticArray) -> None:
    now = str(time.monotonic())
    for status in message.status:
        values = {value.key: value.value for value in status.values}
        level = str(status.level[0])
        of_status = {"level": level, "text": status.message, "hardware_id": status.hardware_id, "heard_s": now}
        heard[status.name] = values | of_status
    draft = path.with_suffix(".draft")
    draft.write_text(json.dumps(heard))
    os.replace(draft, path)


signal.signal(signal.SIGINT, lambda *_: ended.append(True))
rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
node = rclpy.create_node("diagnostics_heard")
node.create_subscription(DiagnosticArray, "/diagnostics", hear, 1000)
while not ended:
    rclpy.spin_once(node, timeout_sec=0.2)
node.destroy_node()
rclpy.shutdown()
