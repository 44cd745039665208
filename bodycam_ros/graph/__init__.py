"""The live graph without ROS: its nodes, their parameters, and what they keep of frames on their way."""
