"""Conversion between messages and dataclasses: the only place where fields of messages are named.

Readers use attributes only, so that one function serves messages from rclpy and from the ``rosbags`` library. Writers
take a ``MessageFactory``, which hides how the two libraries construct a message and store an array.
"""
