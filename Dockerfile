# ROS 2 Jazzy with bodycam_ros:   docker build -t bodycam_ros .
#   docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/data" bodycam_ros bodycam replay BAG --map MAP --body BODY.yaml -o OUT
#   docker run --rm --user "$(id -u):$(id -g)" --net=host --ipc=host -v "$PWD:/data" bodycam_ros \
#     ros2 launch bodycam_ros bodycam.launch.py ...
# docs/install.md says what the steps are for.
FROM ros:jazzy-ros-base

SHELL ["/bin/bash", "-o", "pipefail", "-c"]

# What ROS, rosdep and the compiler of bodycam_msgs need, while only manifests are there: sources change more often.
WORKDIR /opt/bodycam
COPY package.xml src/bodycam_ros/
RUN apt-get update \
 && apt-get install -y --no-install-recommends build-essential python3-colcon-common-extensions python3-dev python3-venv \
 && rosdep update --rosdistro jazzy \
 && rosdep install --from-paths src --ignore-src -y \
 && rm -rf /var/lib/apt/lists/* ~/.ros

# What neither has, beside apt's packages.
COPY pyproject.toml src/bodycam_ros/
RUN python3 -m venv --system-site-packages venv \
 && touch venv/COLCON_IGNORE \
 && venv/bin/python -m pip install --no-cache-dir "pip>=25.1" \
 && venv/bin/python -m pip install --no-cache-dir --group src/bodycam_ros/pyproject.toml:ubuntu "numpy<2"

# Kernels are compiled for every processor with AVX2. colcon is started by /usr/bin/python3, which does not know the
# virtual environment with numba.
ARG BODYCAM_KERNELS_CPU=x86-64-v3
COPY . src/bodycam_ros/
RUN . /opt/ros/jazzy/setup.bash \
 && . venv/bin/activate \
 && export PYTHONPATH="/opt/bodycam/venv/lib/python3.12/site-packages:$PYTHONPATH" \
 && export BODYCAM_KERNELS_CPU="$BODYCAM_KERNELS_CPU" \
 && colcon build \
 && rm -rf build log
COPY docker/entrypoint.sh /bodycam_entrypoint.sh

RUN useradd --uid 1001 --create-home --shell /bin/bash bodycam && install -d -o bodycam -g bodycam /data
USER 1001
WORKDIR /data
# docker stop then ends the graph as Ctrl-C does.
STOPSIGNAL SIGINT
ENTRYPOINT ["/bodycam_entrypoint.sh"]
CMD ["bodycam"]
