"""A robot that does what a person did: links that follow segments, scaled, within the robot's limits."""
