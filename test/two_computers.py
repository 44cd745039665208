"""Two computers and a wire between them, made of namespaces of Linux: each has a network, a name and shared memory of
its own. They and all that runs on them are gone with the test. Addresses exist inside of them only.
"""

import ctypes
import fcntl
import functools
import heapq
import os
import random
import selectors
import shutil
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from ended_with_us import ended_with_us

_NAMESPACES = ("--net", "--mount", "--uts", "--ipc")
_TOOLS = ("unshare", "nsenter", "ip", "mount")
_WIRE = "wire"
_UP_WITHIN_S = 30.0
_ADDRESSES = ("10.77.0.1", "10.77.0.2")

_TUNSETIFF, _IFF_TAP_PLAIN = 0x400454CA, 0x1002
"""Of <linux/if_tun.h>: frames of Ethernet, without a header before them, so that their checksums are whole."""
_LONGEST_FRAME = 65536
_ETH_P_ALL = 3


@dataclass(frozen=True)
class Computer:
    """One end of the wire.

    Attributes:
        name: its host name.
        address: on the wire.
        pid: of the process that keeps it.
    """

    name: str
    address: str
    pid: int

    def command(self, command: Sequence[str]) -> list[str]:
        """A command as it is run there."""
        return ended_with_us(["nsenter", "--target", str(self.pid), *_NAMESPACES, "--", *command])

    def run(self, *command: str) -> str:
        """Run a command there; what it prints."""
        return subprocess.run(self.command(command), check=True, capture_output=True, text=True).stdout

    def start(self, command: Sequence[str], log: Path, environment: Mapping[str, str]) -> "subprocess.Popen[bytes]":
        """Start a process there; what it prints goes to a file."""
        with log.open("w") as said:
            return subprocess.Popen(
                self.command(command), stdout=said, stderr=subprocess.STDOUT, env={**os.environ, **environment}
            )

    def start_counting(self, pattern: bytes) -> "subprocess.Popen[str]":
        """Count the frames on the wire that have some bytes in them; terminated, it prints how many there were."""
        command = self.command([sys.executable, __file__, "count", pattern.hex()])
        counting = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert counting.stdout is not None
        assert counting.stdout.readline() == "up\n", "nobody counts"
        return counting

    def bytes_sent(self) -> int:
        """Over the wire so far, all headers included."""
        lines = Path(f"/proc/{self.pid}/net/dev").read_text().splitlines()
        (counters,) = (line.partition(":")[2].split() for line in lines if line.strip().startswith(f"{_WIRE}:"))
        return int(counters[8])


@functools.cache
def why_not() -> str:
    """Why there can be no two computers here; empty if there can."""
    if lacking := [tool for tool in _TOOLS if shutil.which(tool) is None]:
        return f"{', '.join(lacking)} not found (util-linux, iproute2)"
    made = subprocess.run(["unshare", *_NAMESPACES, "ip", "link", "add", "one", "type", "veth"], capture_output=True)
    return "" if made.returncode == 0 else f"no right to make namespaces and networks: {made.stderr.decode().strip()}"


@contextmanager
def two_computers(
    names: tuple[str, str] = ("worn", "desk"), loss: float = 0.0, delay_s: float = 0.0
) -> Iterator[tuple[Computer, Computer]]:
    """Two computers, up and connected.

    Args:
        names: their host names.
        loss: share of the frames that the wire loses, each way.
        delay_s: how long a frame is on its way.
    """
    keepers: list[subprocess.Popen[str]] = []
    wire = None
    try:
        for name in names:
            steps = ("mount -t tmpfs tmpfs /dev/shm", f"hostname {name}", "ip link set lo up", "echo up")
            command = ended_with_us(["unshare", *_NAMESPACES, "sh", "-c", " && ".join((*steps, "exec sleep inf"))])
            keepers.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
            assert keepers[-1].stdout is not None
            assert keepers[-1].stdout.readline() == "up\n", f"the computer {name} does not come up"
        pids = [keeper.pid for keeper in keepers]
        if loss or delay_s:
            command = [sys.executable, __file__, "carry", *map(str, pids), str(loss), str(delay_s)]
            wire = subprocess.Popen(ended_with_us(command), stdout=subprocess.PIPE, text=True)
            assert wire.stdout is not None
            assert wire.stdout.readline() == "up\n", "the wire does not come up"
        else:
            ends = ["ip", "link", "add", _WIRE, "netns", str(pids[0]), "type", "veth"]
            subprocess.run([*ends, "peer", "name", _WIRE, "netns", str(pids[1])], check=True)
        computers = [Computer(*of) for of in zip(names, _ADDRESSES, pids, strict=True)]
        for computer in computers:
            computer.run("ip", "address", "add", f"{computer.address}/24", "dev", _WIRE)
            computer.run("ip", "link", "set", _WIRE, "up")
        deadline_s = time.monotonic() + _UP_WITHIN_S
        # Who starts before that finds no address, and takes the other computer for its own.
        while not all(_is_up(computer) for computer in computers):
            assert time.monotonic() < deadline_s, "the wire does not come up"
            time.sleep(0.05)
        yield computers[0], computers[1]
    finally:
        for process in (*keepers, *([wire] if wire else [])):
            process.kill()
            process.wait()
            if process.stdout is not None:
                process.stdout.close()


def _is_up(computer: Computer) -> bool:
    """Whether the kernel says so of the wire, which it does up to a second after it is."""
    said = computer.run("ip", "-o", "link", "show", _WIRE)
    return "state UP" in said or "state UNKNOWN" in said


def carry(taps: Sequence[int], loss: float, delay_s: float, seed: int = 0) -> None:
    """Be the wire, for ever: every frame reaches the other end after a while, or does not."""
    chance = random.Random(seed)
    on_the_way: list[tuple[float, int, int, bytes]] = []
    with selectors.DefaultSelector() as selector:
        for end, tap in enumerate(taps):
            selector.register(tap, selectors.EVENT_READ, end)
        count = 0
        while True:
            wait_s = max(0.0, on_the_way[0][0] - time.monotonic()) if on_the_way else None
            for key, _ in selector.select(wait_s):
                frame = os.read(key.fd, _LONGEST_FRAME)
                if chance.random() >= loss:
                    count += 1
                    heapq.heappush(on_the_way, (time.monotonic() + delay_s, count, taps[1 - key.data], frame))
            while on_the_way and on_the_way[0][0] <= time.monotonic():
                _, _, tap, frame = heapq.heappop(on_the_way)
                # An end that is down takes nothing.
                with suppress(OSError):
                    os.write(tap, frame)


def _tap_in(pid: int) -> int:
    """The other side of a network device of another computer."""
    with open(f"/proc/{pid}/ns/net") as there, open("/proc/self/ns/net") as here:
        libc = ctypes.CDLL(None, use_errno=True)
        assert libc.setns(there.fileno(), 0) == 0, os.strerror(ctypes.get_errno())
        tap = os.open("/dev/net/tun", os.O_RDWR)
        fcntl.ioctl(tap, _TUNSETIFF, struct.pack("16sH22x", _WIRE.encode(), _IFF_TAP_PLAIN))
        assert libc.setns(here.fileno(), 0) == 0, os.strerror(ctypes.get_errno())
    return tap


def _count(pattern: bytes) -> None:
    """Count until SIGTERM."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(print(count)))
    count = 0
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(_ETH_P_ALL)) as wire:
        wire.bind((_WIRE, 0))
        print("up", flush=True)
        while True:
            count += pattern in wire.recv(_LONGEST_FRAME)


if __name__ == "__main__":
    what, *given = sys.argv[1:]
    if what == "carry":
        both = [_tap_in(int(pid)) for pid in given[:2]]
        print("up", flush=True)
        carry(both, float(given[2]), float(given[3]))
    else:
        _count(bytes.fromhex(given[0]))
