#!/bin/bash
# Runs a command with ROS, the workspace and the virtual environment.
set -e
. /opt/ros/jazzy/setup.bash
. /opt/bodycam/install/setup.bash
. /opt/bodycam/venv/bin/activate
# ros2 and colcon are started by /usr/bin/python3, which knows of no virtual environment.
export PYTHONPATH="/opt/bodycam/venv/lib/python3.12/site-packages:$PYTHONPATH"
export PATH="/opt/bodycam/install/bodycam_ros/lib/bodycam_ros:$PATH"
# A user of --user whom the image does not know has / as home, and ROS ends where it can write no log.
[ -w "${HOME:-/}" ] || HOME="$(mktemp -d)"
export HOME
exec "$@"
