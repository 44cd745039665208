#!/usr/bin/env bash
# make test-ros: builds the workspace with colcon and runs test_ros/ with the real `ros2 launch`.
# ROS is an installation of Jazzy where there is one, else the environment .venv-ros that ../shared/ros/real_ros2.sh makes.
set -euo pipefail
cd "$(dirname "$0")/.."

maker=../shared/ros/real_ros2.sh jazzy=/opt/ros/jazzy/setup.bash venv=.venv-ros
[ -e "$maker" ] || maker=${REAL_ROS2:-$maker}
if [ -e "$jazzy" ]; then
    setup=$jazzy
elif [ -e "$maker" ]; then
    setup=$venv/setup.bash stamp=$venv/test_ros.stamp
    if [ ! -e "$stamp" ] || [ uv.lock -nt "$stamp" ]; then
        bash "$maker" "$venv"
        make .venv/python.stamp
        .venv/bin/uv export --quiet --frozen --no-hashes --no-emit-project > "$venv/runtime.txt"
        .venv/bin/uv pip install --quiet --python "$venv" -r "$venv/runtime.txt" pytest colcon-bash colcon-core colcon-ros \
            "numba>=0.68,<0.69"
        touch "$stamp"
    fi
else
    echo "make test-ros needs ROS 2 Jazzy with ros2 launch: $jazzy (docs/install.md), or $maker" >&2
    exit 1
fi

set +u
. "$setup"
set -u
python3 -c 'import colcon_ros, pytest' || { echo "missing: sudo apt install colcon python3-pytest" >&2; exit 1; }
out=$PWD/out/ros
# As docs/install.md makes a workspace, with a package of somebody else's that depends on the messages.
mkdir -p "$out/src"
ln -sfn "$PWD" "$out/src/bodycam_ros"
ln -sfn bodycam_ros/msg_defs "$out/src/bodycam_msgs"
ln -sfn bodycam_ros/test_ros/message_consumer "$out/src/message_consumer"
colcon --log-base "$out/log" build --base-paths "$out/src" --build-base "$out/build" --install-base "$out/install"
set +u
. "$out/install/setup.bash"
set -u
python3 -m pytest test_ros -p no:cacheprovider "$@"
