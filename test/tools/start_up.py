"""How long the live graph takes until every node is active, and to end: apart, forked, and in one process.

PYTHONPATH=test python -m tools.start_up [--map MAP --body BODY.yaml --bag BAG] [--ways separate forked one]
"""

import argparse
import os
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from launch_stand_in import LaunchedProcess, performed
from launched import LAUNCH_FILE, REPOSITORY
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from live_graph import Graph, Started, running_graph

_WAYS = ("separate", "forked", "one")
_LONGEST_S = 90.0
_ASK_S = 1.0
_MB = 1 << 20


def main() -> None:
    """Print a line for each way."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    bags = REPOSITORY / "bags"
    parser.add_argument("--map", type=Path, default=bags / "map")
    parser.add_argument("--body", type=Path, default=bags / "body.yaml")
    parser.add_argument("--bag", type=Path, default=bags / "sample/bag")
    parser.add_argument("--rate", default="0.5", help="times the recorded speed, which this machine holds")
    parser.add_argument("--ways", nargs="+", choices=_WAYS, default=_WAYS)
    given = parser.parse_args()
    arguments = {
        "map": str(given.map),
        "body": str(given.body),
        "bagfile": str(given.bag),
        "rate": given.rate,
        "registrations": "4",
    }
    nodes, _ = performed(LAUNCH_FILE, REPOSITORY, processes="separate", **arguments)
    managed = [node.node_name for node in nodes if node.executable != "player"]
    print(f"{len(managed)} nodes and a player on {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print(
        f"{'processes':10} {'active [s]':>10} {'CPU till then [s]':>18} {'memory [MB]':>12} {'end [s]':>8} exit codes"
    )
    for way in given.ways:
        asked = arguments | ({"one_process": "true"} if way == "one" else {"processes": way})
        with tempfile.TemporaryDirectory() as folder, running_graph(Path(folder)) as graph:
            print(f"{way:10} {_measured(graph, Path(folder), asked, managed)}", flush=True)


def _measured(graph: Graph, folder: Path, arguments: dict[str, str], managed: Sequence[str]) -> str:
    nodes, _ = performed(LAUNCH_FILE, REPOSITORY, **arguments)
    begun_s = time.monotonic()
    started = graph.start(*(LaunchedProcess.of(node, folder) for node in nodes))
    _until_active(graph, managed)
    active_s = time.monotonic() - begun_s
    pids = [pid for each in started for pid in _family(each)]
    cpu_s, memory = sum(map(_cpu_s, pids)), sum(map(_memory, pids))
    begun_s = time.monotonic()
    codes = graph.end()
    ended_s = time.monotonic() - begun_s
    return f"{active_s:10.1f} {cpu_s:18.1f} {memory / _MB:12.0f} {ended_s:8.1f} {sorted(set(codes.values()))}"


def _until_active(graph: Graph, managed: Sequence[str]) -> None:
    clients = {name: graph.listener.create_client(GetState, f"/{name}/get_state") for name in managed}
    waiting = dict.fromkeys(managed, (0.0, None))
    deadline_s = time.monotonic() + _LONGEST_S
    while waiting:
        if time.monotonic() > deadline_s:
            raise SystemExit(f"not active: {', '.join(waiting)}\n{graph.report()}")
        for name, (asked_s, answer) in list(waiting.items()):
            if answer is not None and answer.done():
                if answer.result().current_state.id == State.PRIMARY_STATE_ACTIVE:
                    del waiting[name]
                    continue
                waiting[name] = (asked_s, None)
            elif time.monotonic() - asked_s > _ASK_S and clients[name].service_is_ready():
                waiting[name] = (time.monotonic(), clients[name].call_async(GetState.Request()))
        graph.hear(0.02)


def _family(started: Started) -> list[int]:
    pid = started.process.pid
    children = subprocess.run(["pgrep", "-P", str(pid)], capture_output=True, text=True, check=False).stdout
    return [pid, *map(int, children.split())]


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _memory(pid: int) -> int:
    """Bytes, of shared pages the process's share."""
    rollup = Path(f"/proc/{pid}/smaps_rollup").read_text()
    return 1024 * next(int(line.split()[1]) for line in rollup.splitlines() if line.startswith("Pss:"))


if __name__ == "__main__":
    main()
