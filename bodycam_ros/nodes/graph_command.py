"""The live graph by one command, in one process or with a process for every node.

ros2 run bodycam_ros graph --map MAP --body BODY.yaml [--bag BAG] [--processes] [--ros-args --params-file SETTINGS.yaml]
"""

import argparse
import logging
import sys
from pathlib import Path

import cv2
from rclpy.utilities import remove_ros_args

from bodycam_ros.errors import BodycamError
from bodycam_ros.nodes.forked import run_forked
from bodycam_ros.nodes.graph import (
    NodeProcess,
    cameras_of,
    follower,
    human,
    live_graph,
    outside_input,
    player,
    stations_of,
)
from bodycam_ros.nodes.launched import of_host
from bodycam_ros.nodes.one_process import run_in_one
from bodycam_ros.nodes.run import Signals, say

NAME = "graph"


def main() -> int:
    """Run the graph until it is stopped; the exit code."""
    cv2.setNumThreads(1)
    logging.basicConfig(level=logging.WARNING, format="[%(levelname)s] %(message)s")
    signals = Signals()
    arguments = _parser().parse_args(remove_ros_args(sys.argv)[1:])
    try:
        processes = _processes(arguments)
    except BodycamError as error:
        return say(NAME, error)
    if arguments.processes:
        return run_forked(processes, arguments.respawn, signals)
    return run_in_one(processes, signals)


def _processes(arguments: argparse.Namespace) -> list[NodeProcess]:
    """What ``bodycam.launch.py`` starts."""
    graph = live_graph(
        arguments.map,
        arguments.body,
        arguments.cameras,
        arguments.registrations,
        arguments.rig,
        arguments.overwrite_body,
        arguments.grown_map,
        arguments.equipment,
        outside_input(arguments.stations, arguments.surface, arguments.start),
    )
    graph += follower(arguments.robot, arguments.mapping) + human(arguments.humans)
    here = of_host(graph, arguments.nodes)
    if arguments.bag is not None:
        here.append(player(arguments.bag, arguments.rate, cameras_of(graph), arguments.loop, stations_of(graph)))
    return here


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(NAME, description=__doc__)
    parser.add_argument("--map", type=Path, help="folder of the reference map, made by 'bodycam map'")
    parser.add_argument("--body", type=Path, required=True, help="body YAML; with --rig it is written")
    parser.add_argument("--cameras", nargs="+", default=[], help="those to use; all of the body if not given")
    parser.add_argument("--registrations", type=int, default=1, help="nodes that share the registration")
    parser.add_argument("--grown-map", type=Path, help="folder in which registrations keep what their maps grow by")
    parser.add_argument("--rig", type=Path, help="rig YAML, to make the body from a range of motion (~/calibrate)")
    parser.add_argument("--overwrite-body", action="store_true", help="with --rig: replace a body that is there")
    parser.add_argument("--equipment", default="", help="what the person rides, holds or stands on: a file or a name")
    parser.add_argument("--stations", type=Path, help="YAML of static cameras: where they stand, their lenses")
    parser.add_argument("--surface", type=Path, help="with --stations: folder of the segments' meshes")
    parser.add_argument("--start", type=Path, help="with --stations: YAML of where the person stands at first")
    parser.add_argument("--robot", type=Path, help="URDF of a robot that follows the person")
    parser.add_argument("--mapping", type=Path, help="with --robot: YAML of which links of it follow what")
    parser.add_argument("--humans", default="", metavar="ID", help="REP-155's id of the body, to say all as it does")
    parser.add_argument("--nodes", nargs="+", default=[], help="those to run, by kind or name; all if not given")
    parser.add_argument("--processes", action="store_true", help="every node in a process of its own")
    parser.add_argument(
        "--respawn", type=float, metavar="S", help="with --processes: start who ended again after so many seconds"
    )
    parser.add_argument("--bag", type=Path, help="ros2 bag or .mcap file to play")
    parser.add_argument("--rate", type=float, default=1.0, help="with --bag: times the recorded speed")
    parser.add_argument("--loop", action="store_true", help="with --bag: play it again and again")
    return parser
