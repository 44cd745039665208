"""Run a study of 6 short recordings and a broken one, against its parts: python test/tools/study_campaign.py DIR.

All is made of ``bags/``: two subjects, one of whose bodies is made of its range of motion, and two places, one of whose
maps is made of photographs. Printed are the seconds of the study, of its jobs alone as they took them side by side, of
the same commands by hand, one after the other on the same cores, and of a second run, in which only the broken one is
tried again. On a machine that does other things as well only the first two can be compared.
"""

import argparse
import csv
import json
import os
import resource
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import yaml
from cut_recording import cut_bag, cut_truth

BAGS = Path(__file__).parents[2] / "bags"
LEGS = ("waist_front", "thigh_left", "shin_left", "thigh_right")
CUTS = {"early": (0.0, 1.0, None), "late": (1.0, 1.0, None), "short": (0.0, 0.5, None), "legs": (0.0, 2.0, LEGS)}
"""Name -> start [s], duration [s], cameras or None for all."""

WHOLE = ("whole", "again")

BODYCAM = [sys.executable, "-m", "bodycam_ros.cli.main"]


def make_study(folder: Path) -> Path:
    """Lay out the recordings and the file that describes them."""
    takes = folder / "takes"
    takes.mkdir(parents=True)
    cameras = yaml.safe_load((BAGS / "sample" / "rig.yaml").read_text())["cameras"]
    for name in WHOLE:
        shutil.copytree(BAGS / "sample" / "bag", takes / name)
    for name, (start_s, duration_s, chosen) in CUTS.items():
        cut_bag(BAGS / "sample" / "bag", takes / name, start_s, duration_s, chosen or list(cameras), 1)
        cut_truth(
            BAGS / "sample" / "truth" / "segments", folder / "truth" / name / "truth" / "segments", start_s, duration_s
        )
    for name in WHOLE:
        shutil.copytree(BAGS / "sample" / "truth", folder / "truth" / name / "truth")
    for truth in (folder / "truth").iterdir():
        shutil.copy(BAGS / "sample" / "rig.yaml", truth)
    shutil.copytree(BAGS / "sample" / "bag", takes / "broken")
    bag = next((takes / "broken").glob("*.mcap"))
    os.truncate(bag, bag.stat().st_size // 2)
    bags = os.path.relpath(BAGS, folder)
    study = {
        "places": {"hall": {"map": f"{bags}/map"}, "corner": {"reference": f"{bags}/reference"}},
        "subjects": {
            "walker": {"body": f"{bags}/body.yaml"},
            "legs": {"rig": f"{bags}/rom/rig.yaml", "range_of_motion": f"{bags}/rom/bag", "place": "hall"},
        },
        "recordings": [
            *(
                {"path": f"takes/{name}", "subject": "walker", "place": "hall", "truth": "truth/{name}"}
                for name in (*WHOLE, "early", "late", "short")
            ),
            {"path": "takes/legs", "subject": "legs", "place": "corner"},
            {"path": "takes/broken", "subject": "walker", "place": "hall"},
        ],
        "exports": ["bvh"],
    }
    path = folder / "study.yaml"
    path.write_text(yaml.safe_dump(study, sort_keys=False))
    return path


def by_hand(study: Path, cores: int) -> None:
    """Run every command of a written workflow but those of the broken recording, one after the other."""
    folder = study.parent / "by_hand"
    folder.mkdir()
    stages = json.loads((study.with_suffix("") / "steps.json").read_text())["steps"]
    for stage, jobs in stages.items():
        for job in jobs.values():
            if job["name"].startswith("broken"):
                continue
            for made in job["makes"]:
                (folder / made).parent.mkdir(parents=True, exist_ok=True)
            jobs_flag = ["--jobs", str(cores)] if stage not in ("evaluate", "export") else []
            done = subprocess.run(
                [*BODYCAM, *shlex.split(job["words"]), *jobs_flag], cwd=folder, stdout=subprocess.DEVNULL
            )
            assert done.returncode in (0, 3), job["name"]


def timed(what: str, words: Sequence[str] | None, study: Path, cores: int) -> float:
    """Seconds of a command, or of all of them by hand."""
    used, began = _cpu_s(), time.monotonic()
    if words is None:
        by_hand(study, cores)
    else:
        subprocess.run([*BODYCAM, *words], check=False)
    took = time.monotonic() - began
    print(f"{what}: {took:.1f} s, {_cpu_s() - used:.1f} s of all cores", flush=True)
    return took


def busy(study: Path, cores: int) -> float:
    """Seconds that the jobs of a study would take if no core ever waited: what they took, times the cores they had."""
    folder = study.with_suffix("")
    threads = json.loads((folder / "steps.json").read_text())["threads"]
    spent = 0.0
    for path in folder.glob("logs/**/*.tsv"):
        with path.open() as file:
            seconds = float(next(csv.DictReader(file, delimiter="\t"))["s"])
        spent += seconds * min(cores, threads[path.relative_to(folder / "logs").parts[0]])
    return spent / cores


def _cpu_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="is made, and kept to look at")
    parser.add_argument("--cores", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--profile", help="as of 'bodycam study'")
    arguments = parser.parse_args()
    study = make_study(arguments.folder.absolute())
    words = ["study", str(study)]
    words += ["--profile", arguments.profile] if arguments.profile else ["--cores", str(arguments.cores)]
    timed("dry run", [*words, "--dry-run"], study, arguments.cores)
    first = timed("study", words, study, arguments.cores)
    jobs = busy(study, arguments.cores)
    print(f"its jobs alone: {jobs:.1f} s, the study took {first / jobs:.3f} times that", flush=True)
    parts = timed("its parts", None, study, arguments.cores)
    timed("second run", words, study, arguments.cores)
    print(f"the study took {first / parts:.2f} times what the same commands took by hand")


if __name__ == "__main__":
    main()
