"""bodycam keystore: keys for the live graph, so that nobody else in the network hears it or speaks in it (SROS 2).

Each process gets a key and may say and hear what it needs, and nothing else. A keystore that is there is brought up to
date: its authority and its keys stay, what each may do is written anew.
"""

import argparse
import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table

from bodycam_ros.errors import SettingsError
from bodycam_ros.output_place import check_output
from bodycam_ros.shown import printable
from bodycam_ros.terminal import Terminal

if TYPE_CHECKING:
    from collections.abc import Mapping

    from bodycam_ros.secured.access import Access
    from bodycam_ros.secured.keystore import Made

_MOST_DOMAIN = 232
_ROBOT = "robot"


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("keystore", description=__doc__)
    known = parser.add_mutually_exclusive_group(required=True)
    known.add_argument("--body", type=Path, metavar="YAML", help="body whose cameras the graph tracks")
    known.add_argument("--rig", type=Path, metavar="YAML", help="rig, where there is no body yet")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="KEYSTORE", help="folder to make or extend")
    parser.add_argument("--cameras", nargs="+", default=(), metavar="NAME", help="as of the launch file (default: all)")
    parser.add_argument(
        "--registrations", type=int, default=4, metavar="N", help="as of the launch file (default: %(default)s)"
    )
    parser.add_argument("--equipment", default="", metavar="NAME", help="what the person rides, holds or stands on")
    parser.add_argument("--stations", type=Path, metavar="YAML", help="static cameras")
    parser.add_argument(
        "--robot", default=_ROBOT, metavar="NAME", help="namespace of a robot that follows (default: %(default)s)"
    )
    parser.add_argument("--namespace", default="/", metavar="NAME", help="that the graph runs in (default: none)")
    parser.add_argument(
        "--domain", type=int, metavar="N", help=f"DDS domain, 0 to {_MOST_DOMAIN} (default: ROS_DOMAIN_ID, or 0)"
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from bodycam_ros.nodes.graph import NodeProcess, live_graph, player
    from bodycam_ros.outside.outside_files import OutsideInput
    from bodycam_ros.secured.enclaves import enclaves_of
    from bodycam_ros.secured.keystore import make_keystore

    domain = _domain(arguments.domain)
    check_output(arguments.output, (arguments.body, arguments.rig, arguments.stations))
    outside = None if arguments.stations is None else OutsideInput(arguments.stations)
    # Which map it is does not matter to who may say what.
    graph = live_graph(
        Path("map"),
        arguments.body or arguments.rig,
        arguments.cameras,
        arguments.registrations,
        arguments.rig,
        equipment=arguments.equipment,
        outside=outside,
    )
    robot, person = NodeProcess("retarget", "retarget", {"robot": arguments.robot}), NodeProcess("humans", "humans")
    graph += [robot, person, player(Path("bag"), 1.0)]
    enclaves = enclaves_of(graph, arguments.namespace)
    made = make_keystore(arguments.output, enclaves, domain)
    _tell(arguments.output, enclaves, made, domain)
    return 0


def _domain(given: int | None) -> int:
    text = os.environ.get("ROS_DOMAIN_ID") or "0" if given is None else str(given)
    if not (text.isdecimal() and int(text) <= _MOST_DOMAIN):
        raise SettingsError(f"a DDS domain is a number from 0 to {_MOST_DOMAIN}, not '{text}'; give it with --domain")
    return int(text)


def _tell(keystore: Path, enclaves: "Mapping[str, Access]", made: "Made", domain: int) -> None:
    table = Table(
        title=f"keys for DDS domain {domain}", caption="topics and services that each may; all else is denied"
    )
    table.add_column("enclave", no_wrap=True)
    for column in ("says", "hears", "serves", "asks"):
        table.add_column(column, justify="right")
    table.add_column("key")
    for enclave, may in enclaves.items():
        counts = (len(part) for part in (may.publishes, may.subscribes, may.serves, may.calls))
        table.add_row(enclave, *map(str, counts), "new" if enclave in made.new else "kept")
    terminal = Terminal()
    terminal.print(table)
    if made.others:
        terminal.print(f"Left as they were: {', '.join(map(printable, made.others))}", soft_wrap=True)
    place = printable(shlex.quote(str(keystore.resolve())))
    terminal.print(
        f"On each machine: export ROS_SECURITY_KEYSTORE={place} ROS_SECURITY_ENABLE=true "
        "ROS_SECURITY_STRATEGY=Enforce, and start each node with --ros-args --enclave /ITS_NAME.\n"
        f"Keep private/ in {place} to yourself: who has it can make keys. Another machine needs public/ and the "
        "folders of its own nodes in enclaves/.",
        soft_wrap=True,
    )
