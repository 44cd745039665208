"""A recording through the live graph on two computers, made of namespaces of the network: what of it arrives, how late.

    PYTHONPATH=test python -m tools.two_computers_run BAG MAP BODY [--finding peers] [--rate 0.2] [--loss 0.05]

Every camera's tracker runs on one of them with the player, registrations and solver on the other. Needs ROS 2 and the
right to make namespaces.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from graph_apart import PROFILE, Passed, RunApart, run_apart
from two_computers import two_computers, why_not

_WAIT_FOR_LOST_S = 8.0


def report(run: RunApart) -> str:
    """What came of a run, a line for each figure."""
    rates = [count / run.played_s / 1e3 for count in run.sent_bytes]
    clocks = [way for name, way in run.diagnostics.items() if name.startswith("registration") and ": way of" in name]
    ahead = [f"{way['clock ahead by [ms]']} +- {way['clock ahead known to [ms]']}" for way in clocks]
    return "\n".join(
        (
            f"instants solved: {run.instants}; played in {run.played_s:.1f} s",
            _line("tracks", run.tracks),
            _line("landmarks", run.landmarks),
            f"over the wire: {rates[0]:.0f} kB/s from the cameras, {rates[1]:.0f} kB/s to them",
            f"times that registrations missed tracks: {sum(int(way['times lost']) for way in clocks)}",
            f"delay of tracks as registrations tell it, median of each camera [ms]: "
            f"{', '.join(way['delay, median [ms]'] for way in clocks)}",
            f"clock ahead by [ms]: {', '.join(ahead)}",
            f"exit codes: {sorted(set(run.exit_codes.values()))}",
        )
    )


def _line(name: str, passed: Passed) -> str:
    median, most = 1e3 * np.percentile(passed.delays_s, (50, 99)) if passed.heard else (np.nan, np.nan)
    return (
        f"{name}: {passed.sent} sent, {passed.heard} heard, {passed.lost} lost; from publishing to callback "
        f"{median:.1f} ms median, {most:.1f} ms 99 %"
    )


def main() -> int:
    """Run it once; 1 if anything was lost."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("bag", "map", "body"):
        parser.add_argument(name, type=Path)
    parser.add_argument("--finding", choices=["server", "peers", "multicast"], default="server")
    parser.add_argument("--cameras", default="", help="names with commas; all of the body if empty")
    parser.add_argument("--registrations", type=int, default=2)
    parser.add_argument("--rate", type=float, default=0.2, help="times the recorded speed")
    parser.add_argument("--loss", type=float, default=0.0, help="share of the frames that the wire loses, each way")
    parser.add_argument("--delay", type=float, default=0.0, help="[ms] that a frame is on its way")
    parser.add_argument("--profile", type=Path, default=PROFILE, help="of Fast DDS (default: that for networks)")
    arguments = parser.parse_args()
    if reason := why_not():
        parser.error(reason)
    cameras = [camera for camera in arguments.cameras.split(",") if camera]
    wire = {"loss": arguments.loss, "delay_s": 1e-3 * arguments.delay}
    with tempfile.TemporaryDirectory() as folder, two_computers(**wire) as (worn, desk):
        run = run_apart(
            *(worn, desk, Path(folder), arguments.finding),
            *(arguments.bag.absolute(), arguments.map.absolute(), arguments.body.absolute(), cameras),
            arguments.registrations,
            arguments.rate,
            quiet_s=_WAIT_FOR_LOST_S if arguments.loss else 1.0,
            profile=arguments.profile.absolute(),
        )
    print(report(run))
    return int(bool(run.tracks.lost or run.landmarks.lost))


if __name__ == "__main__":
    sys.exit(main())
