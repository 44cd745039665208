"""The stages as ROS 2 nodes: message <-> array, parameters, quality of service. The only place that imports ROS."""
