"""What was built installs in an environment that knows nothing of the sources, and works there.

python release/wheel_check.py dist      (make wheel-check builds them first; takes some minutes)
"""

import json
import os
import subprocess
import sys
import tempfile
import venv
from collections.abc import Sequence
from pathlib import Path

SOURCES = Path(__file__).resolve().parent.parent
SAMPLE = SOURCES / "bags"
LIVE = ["--cameras", "2", "--delays", "4", "--rate", "0.5"]
"""Nodes that two shared cores bear; that all sixteen do is tested elsewhere."""

LOOK = """
import json, sys
from importlib.metadata import version
from pathlib import Path
import bodycam_msgs, bodycam_ros
from bodycam_msgs.msg import FeatureTracks
from bodycam_ros.body.equipment_yaml import read_equipment
from bodycam_ros.body.equipment_yaml import supplied_equipment
from bodycam_ros.share_folder import share_folder
from rclpy.serialization import deserialize_message, serialize_message
sent = FeatureTracks(keyframe=True)
assert deserialize_message(serialize_message(sent), FeatureTracks) == sent
assert version("bodycam-msgs") == version("bodycam-ros") == bodycam_ros.__version__
assert [read_equipment(name).name for name in supplied_equipment()] == list(supplied_equipment())
assert (Path(bodycam_ros.__file__).parent / "py.typed").is_file()
share = share_folder()
print(json.dumps({
    "modules": [bodycam_ros.__file__, bodycam_msgs.__file__, str(share)],
    "shared": sorted(str(file.relative_to(share)) for file in share.rglob("*") if file.is_file()),
}))
"""


def shared_by(sources: Path) -> set[str]:
    """What of config/ and launch/ a user is to find."""
    found = {path for folder in ("config", "launch") for path in (sources / folder).rglob("*") if path.is_file()}
    return {str(path.relative_to(sources)) for path in found if "__pycache__" not in path.parts}


def made_environment(folder: Path, dist: Path) -> Path:
    """A new virtual environment with what was built and what that asks for; its folder of programs."""
    venv.create(folder, with_pip=True)
    programs = folder / "bin"
    told = ["--quiet", "--disable-pip-version-check", "-c", str(SOURCES / "constraints.txt")]
    ran(
        [str(programs / "python"), "-m", "pip", "install", *told, "--find-links", str(dist), "bodycam-ros[ros]"],
        folder,
    )
    return programs


def ran(command: Sequence[str], folder: Path) -> str:
    """What a command prints; an end of ours if it fails."""
    told = {name: os.environ[name] for name in ("HOME", "LANG", "TERM") if name in os.environ}
    environment = {**told, "PATH": f"{folder}/bin:/usr/bin:/bin", "PYTHONNOUSERSITE": "1"}
    shown = " ".join(command).replace(f"{folder}/", "").replace(f"{SOURCES}/", "").strip()
    print(f"  {shown.splitlines()[0][:110]}", flush=True)
    # No folder of the sources is where Python looks for modules.
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(command)[:200]} ended with {done.returncode}:\n{done.stdout[-2000:]}{done.stderr[-4000:]}")
    return done.stdout


def main(dist: Path) -> None:
    """Install, look, replay, evaluate, and run the live graph."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "environment"
        programs = made_environment(folder, dist)
        bodycam = str(programs / "bodycam")
        looked = json.loads(ran([str(programs / "python"), "-c", LOOK], folder).splitlines()[-1])
        for path in looked["modules"]:
            if not Path(path).is_relative_to(folder):
                sys.exit(f"{path} is not of the new environment: the sources reach into it")
        if missing := shared_by(SOURCES) - set(looked["shared"]):
            sys.exit(f"the wheel lacks {', '.join(sorted(missing))}; name them in data_files of setup.py")
        print(" ", ran([bodycam, "--version"], folder).strip())
        bag, known = str(SAMPLE / "sample/bag"), ["--map", str(SAMPLE / "map"), "--body", str(SAMPLE / "body.yaml")]
        settings = f"{folder}/share/bodycam_ros/config/all_settings.yaml"
        ran([bodycam, "replay", bag, *known, "--config", settings, "-o", "out"], folder)
        ran([bodycam, "evaluate", "out", "--truth", str(SAMPLE / "sample"), "-o", "report"], folder)
        ran([bodycam, "export", "out", "--to", "bvh", "-o", "walk.bvh"], folder)
        ran([bodycam, "latency", bag, *known, *LIVE], folder)
    print("what was built installs and works without the sources")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]).resolve())
