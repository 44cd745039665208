"""Where recordings, map and scratch folder are, and the commands that every measurement starts with."""

import threading
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import yaml

from benchmarks.figures.command import Ran, bodycam
from benchmarks.figures.figure import Figure
from benchmarks.figures.score import Score

REPOSITORY = Path(__file__).parents[2]


@dataclass
class Bench:
    """One run of the table.

    Attributes:
        work: scratch folder.
        shared: ../shared, or None where it is not on this machine.
        jobs: processes of each command.
    """

    work: Path
    shared: Path | None
    jobs: int = 2
    _bodies: dict[str, Path] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def map(self) -> Path:
        """The map of all recordings; the repository carries it."""
        return REPOSITORY / "bags/map"

    def recording(self, name: str) -> Path:
        """Folder of a recording; ``sample`` is the repository's."""
        if name == "sample":
            return REPOSITORY / "bags/sample"
        assert self.shared is not None
        return self.shared / "recordings" / name

    def body(self, of: str = "dev_rom", bag: Path | None = None, *flags: object) -> Path:
        """Body of a range of motion, calibrated once; of the sample that which the repository carries."""
        if of == "sample":
            return REPOSITORY / "bags/body.yaml"
        name = " ".join(map(str, (of, *([bag.name] if bag else []), *(f for f in flags if not isinstance(f, Path)))))
        with self._lock:
            if name not in self._bodies:
                path, recording = self.work / f"{name}.body.yaml", self.recording(of)
                given = (bag or recording / "bag", "--map", self.map, "--rig", recording / "rig.yaml")
                bodycam("body", *given, "-o", path, "--jobs", self.jobs, *flags)
                self._bodies[name] = path
            return self._bodies[name]

    def body_with_sensors(self) -> Path:
        """Body of ``dev_rom``, with its inertial sensors calibrated."""
        return self.body("dev_rom", None, "--imu", self.recording("dev_rom") / "imu")

    def cameras(self, name: str) -> list[str]:
        """Cameras of a recording, by its rig file."""
        return list(yaml.safe_load((self.recording(name) / "rig.yaml").read_text())["cameras"])

    def replay(self, name: str, bag: Path, body: Path, *flags: object, in_map: Path | None = None) -> Ran:
        """Replay a bag into ``self.out(name)``; ``flags`` with --stations bring their own world."""
        placed = () if "--stations" in flags else ("--map", in_map or self.map)
        out = ("-o", self.out(name), "--jobs", self.jobs)
        return bodycam("replay", bag, *placed, "--body", body, *out, *flags)

    def out(self, name: str) -> Path:
        """Where the result of that name is."""
        return self.work / name


def verdict(ran: Ran) -> str:
    """The word after ``verdict:``."""
    with suppress(IndexError):
        return ran.output.rsplit("verdict: ", 1)[1].split(":")[0].split()[0]
    return "none"


def errors(group: str, scored: Score) -> Iterator[Figure]:
    """Mean and worst errors of all joints, and how much of the recording there is."""
    position, rotation = (np.stack(list(each.values())) for each in (scored.position_cm, scored.rotation_deg))
    yield Figure(f"{group}: joint position, mean [cm]", float(position.mean()))
    yield Figure(f"{group}: joint position, max [cm]", float(position.max()))
    yield Figure(f"{group}: joint rotation, mean [deg]", float(rotation.mean()))
    yield Figure(f"{group}: joint rotation, max [deg]", float(rotation.max()))
    yield Figure(f"{group}: coverage", scored.coverage)
