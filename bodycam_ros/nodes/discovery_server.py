"""Fast DDS's discovery server, where the nodes of several computers find each other without multicast. Imports no ROS.

The one that the wheels bring does not find its libraries by itself: they are beside the packages of Python.
"""

import errno
import os
import shutil
import socket
import sys
import sysconfig
from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.errors import BodycamError

PORT = 11811
"""Where Fast DDS looks for a server if an address alone is given."""

_PROGRAM = "fast-discovery-server"
_LIBRARIES = "ros_fastrtps.libs"


@dataclass(frozen=True)
class DiscoveryServer:
    """How a server is started.

    Attributes:
        command: its program and arguments.
        libraries: folders in which its libraries are looked for first.
    """

    command: tuple[str, ...]
    libraries: tuple[Path, ...] = ()

    def environment(self) -> dict[str, str]:
        """That of this process, and where the libraries are."""
        before = os.environ.get("LD_LIBRARY_PATH")
        folders = [*map(str, self.libraries), *([before] if before else [])]
        return {**os.environ, **({"LD_LIBRARY_PATH": os.pathsep.join(folders)} if folders else {})}


def discovery_server(address: str, port: int = PORT, number: int = 0, prefix: Path | None = None) -> DiscoveryServer:
    """The server of the wheels, if they are installed here; else that of a ROS installation.

    Args:
        address: of this computer, by which the others reach it; a name does as well.
        port: UDP port.
        number: of the server, its place in ``ROS_DISCOVERY_SERVER``, from 0.
        prefix: of the environment with the wheels; this process' own if None.

    Raises:
        BodycamError: there is none.
    """
    wanted = ("--server-id", str(number), "--udp-address", address, "--udp-port", str(port))
    home = prefix or Path(sys.prefix)
    bundled = Path(sysconfig.get_path("platlib", vars={"platbase": str(home)})) / _LIBRARIES
    program = home / "bin" / _PROGRAM
    if program.is_file() and bundled.is_dir():
        return DiscoveryServer((str(program), *wanted), (home / "lib", bundled))
    if installed := shutil.which(_PROGRAM):
        return DiscoveryServer((installed, *wanted))
    raise BodycamError(
        f"there is no {_PROGRAM} here: 'make latency' installs ROS 2's wheels, which have it; with ROS 2 from apt, "
        "source its setup.bash first (package ros-jazzy-rmw-fastrtps-cpp)"
    )


def check_address(address: str, port: int) -> None:
    """Look whether a server can listen there; Fast DDS says that it runs even where nobody can reach it.

    Raises:
        BodycamError: the address is not known or not this computer's, or the port is taken.
    """
    try:
        (*_, place) = socket.getaddrinfo(address, port, socket.AF_INET, socket.SOCK_DGRAM)[0]
    except (socket.gaierror, UnicodeError) as error:
        raise BodycamError(
            f"'{address}' is no IPv4 address, nor a name that is known here; 'ip -4 address' lists this computer's"
        ) from error
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as trial:
        try:
            trial.bind(place)
        except OSError as error:
            what = {
                errno.EADDRNOTAVAIL: "it is not an address of this computer; 'ip -4 address' lists those",
                errno.EADDRINUSE: "the port is taken; a server may be running already, else choose another by --port",
            }
            reason = what.get(error.errno or 0, error.strerror)
            raise BodycamError(f"no server can listen on {address}:{port}: {reason}") from error


def servers_named(address: str, port: int = PORT, number: int = 0) -> str:
    """What ``ROS_DISCOVERY_SERVER`` is to be for a server: those with lower numbers are left empty."""
    return number * ";" + f"{address}:{port}"
