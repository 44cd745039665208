"""Messages to dataclasses and back: the only place that knows the fields of messages.

Reading touches attributes only, so the same function serves messages from rclpy and from the ``rosbags`` library.
Writing goes through a ``MessageFactory``, which hides how the two make a message and what an array field stores.
"""
