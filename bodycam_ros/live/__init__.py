"""The live graph without ROS: which nodes there are, their parameters, and what they remember of frames on their way."""
