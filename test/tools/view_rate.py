"""How many pictures a second the page of 'bodycam view' shows.

    python test/tools/view_rate.py --map MAP --body BODY.yaml [--coarse]

A body file and its N-pose are made into a solved bag of so many instants in which it walks on the spot, and played in a
headless Chromium that renders in software. Says too how much processor time a picture costs, which a busy machine does
not change as much.
"""

import argparse
import os
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from known_walk import FRAME_NS, START_NS, Walk, write_solved
from view_in_browser import BrowserView, find_chromium, served

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint_angles import JointAngles
from bodycam_ros.view.motion import Motion

_SWING = 0.5  # [rad] of hips and shoulders
_MEASURED_S = 5.0
_COUNT_FRAMES = """milliseconds => new Promise(done => {
    let count = 0
    const start = performance.now()
    const next = () => { count++; performance.now() - start < milliseconds ? requestAnimationFrame(next) : done(count) }
    requestAnimationFrame(next)
})"""


def walking(body: BodyModel, instants: int) -> Walk:
    """A body that swings its limbs about the axis to the left."""
    angles = JointAngles(body)
    world_T_root = Motion.standing(body).world_T_root[0]
    poses = []
    for instant in range(instants):
        swing = _SWING * np.sin(2.0 * np.pi * instant / 30.0)
        turned = [swing * (1 if "left" in name else -1) if name.endswith("_y") else 0.0 for name in angles.names]
        poses.append(body.forward_kinematics(world_T_root, angles.poses(np.array(turned))))
    return Walk(body, START_NS + FRAME_NS * np.arange(instants, dtype=np.int64), np.stack(poses))


def processor_ms() -> Counter[str]:
    """Processor time so far of the view and of the browser, which are children of this process [ms]."""
    children: dict[int, list[tuple[int, float]]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue  # it has ended
        spent = 1e3 * (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
        children.setdefault(int(fields[1]), []).append((int(stat.parent.name), spent))
    total: Counter[str] = Counter()
    waiting = [os.getpid()]
    while waiting:
        for child, spent in children.get(waiting.pop(), []):
            waiting.append(child)
            is_view = b"bodycam_ros.cli.main" in Path(f"/proc/{child}/cmdline").read_bytes()
            total["view" if is_view else "browser"] += spent
    return total


def main() -> None:
    """Measure and say it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--map", type=Path, required=True)
    parser.add_argument("--body", type=Path, required=True)
    parser.add_argument("--instants", type=int, default=1000)
    parser.add_argument("--coarse", action="store_true", help="as 'bodycam view --coarse'")
    arguments = parser.parse_args()
    chromium = find_chromium()
    if chromium is None:
        sys.exit("there is no Chromium on this machine: apt-get install chromium")
    with tempfile.TemporaryDirectory() as folder:
        out = write_solved(walking(read_body(arguments.body), arguments.instants), Path(folder) / "out")
        given = (out, "--map", arguments.map, "--body", arguments.body, *(["--coarse"] if arguments.coarse else []))
        with served(*given) as running, BrowserView.opened(running.address, chromium) as view:
            view.press("Play")
            time.sleep(1.0)
            before, start = processor_ms(), time.monotonic()
            frames = view.page.evaluate(_COUNT_FRAMES, 1e3 * _MEASURED_S)
            seconds, spent = time.monotonic() - start, processor_ms() - before
    print(
        f"{arguments.instants} instants: {frames / seconds:.1f} pictures a second; a picture takes "
        f"{spent['view'] / frames:.1f} ms of processor time in the view, "
        f"{spent['browser'] / frames:.1f} ms in the browser; "
        f"load of the machine {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    )


if __name__ == "__main__":
    main()
