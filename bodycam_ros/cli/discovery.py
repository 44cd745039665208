"""``bodycam discovery``: the place where nodes on several computers find each other."""

import argparse
import os
from typing import Any

_HIGHEST_PORT = 65535
_MOST_SERVERS = 255


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "discovery",
        help="let the nodes of several computers find each other",
        description="Run Fast DDS's discovery server until Ctrl-C. Every node of every computer then finds the others "
        "by it, where there is no multicast or too many nodes for it. What nodes say to each other does not go "
        "through it. Anybody who reaches the address can join: use it in a network of your own.",
    )
    parser.add_argument(
        "address", metavar="ADDRESS", help="IPv4 address or name of this computer, as the others reach it"
    )
    parser.add_argument("--port", type=_port, default=11811, help="UDP port (default: 11811)")
    parser.add_argument(
        "--id",
        type=_number,
        default=0,
        dest="number",
        metavar="N",
        help="which server it is, if there are several, from 0 (default: 0)",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Become the server."""
    from bodycam_ros.nodes.discovery_server import check_address, discovery_server, servers_named

    check_address(arguments.address, arguments.port)
    server = discovery_server(arguments.address, arguments.port, arguments.number)
    named = servers_named(arguments.address, arguments.port, arguments.number)
    print(
        "in every terminal of every computer, before a node is started there:\n"
        f"    export ROS_DISCOVERY_SERVER='{named}'\n"
        "for tools that look at the whole graph (ros2 topic, bodycam view --live, RViz) also:\n"
        "    export ROS_SUPER_CLIENT=TRUE",
        flush=True,
    )
    os.execve(server.command[0], server.command, server.environment())


def _port(text: str) -> int:
    if not 0 < (port := int(text)) <= _HIGHEST_PORT:
        raise argparse.ArgumentTypeError(f"must be 1 to {_HIGHEST_PORT}")
    return port


def _number(text: str) -> int:
    if not 0 <= (number := int(text)) < _MOST_SERVERS:
        raise argparse.ArgumentTypeError(f"must be 0 to {_MOST_SERVERS - 1}")
    return number
