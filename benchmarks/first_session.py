"""A first session as it goes wrong: python -m benchmarks.first_session RECORDINGS MAP WORK [--only WORD].

RECORDINGS has dev_gopro_rom and dev_gopro_walk, of which MP4s and rig.yaml are used; MAP is a map of their hall. Each
case spoils something, runs the real command without a terminal, and prints a row: what was done, exit code, first line
that matters, right or wrong. WORK keeps what was made, so that a second run starts where the first ended.
All cases take 2.5 minutes on two idle cores, 8 beside other work.
"""

import argparse
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import av
import numpy as np
import yaml

from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.geometry import Array
from bodycam_ros.messages.factory import stamp_ns, time_message
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages

SAMPLE_ROM = Path(__file__).parents[1] / "bags" / "rom"
SAMPLE_MAP = SAMPLE_ROM.parent / "map"
_BACKWARDS_S = 4.0
_TALLER, _MOVED_M = 1.12, 0.03
_SHORT_S = 0.5
_LOUD = ("wrong: ", "WARNING: ", "doubtful: ", "bodycam: error: ", "verdict: ")


@dataclass(frozen=True)
class Case:
    """A command, and what is right: its exit code, and what is in the first line that matters."""

    done: str
    command: tuple[object, ...]
    code: int
    words: tuple[str, ...] = ()


@dataclass(frozen=True)
class Session:
    """Inputs and the folder for what is made of them."""

    recordings: Path
    map: Path
    work: Path

    @cached_property
    def rig(self) -> dict[str, dict[str, str]]:
        """The rig file as a mapping."""
        loaded: dict[str, dict[str, str]] = yaml.safe_load((self.recordings / "dev_gopro_rom" / "rig.yaml").read_text())
        return loaded

    def bag(self, name: str) -> Path:
        """The bag of a recording's videos."""
        bag = self.work / name
        if not bag.exists():
            run(("ingest", self.recordings / name / "mp4", "-o", bag, "--force"))
        return bag

    @cached_property
    def body(self) -> Path:
        """The body of the range of motion."""
        body = self.work / "body.yaml"
        if not body.exists():
            run(("body", self.bag("dev_gopro_rom"), "--map", self.map, "--rig", self.rig_with(()), "-o", body))
        return body

    def rig_with(self, exchanged: tuple[str, ...]) -> Path:
        """A rig file in which left and right of some segments are exchanged."""
        other: dict[str, str] = {}
        for kind in exchanged:
            other |= {f"{kind}_left": f"{kind}_right", f"{kind}_right": f"{kind}_left"}
        cameras = {camera: other.get(segment, segment) for camera, segment in self.rig["cameras"].items()}
        path = self.work / f"rig_{'_'.join(exchanged) or 'as_it_is'}.yaml"
        path.write_text(yaml.safe_dump({**self.rig, "cameras": cameras}))
        return path

    def videos_with(self, name: str, camera: str, length_s: float, with_sound: bool) -> Path:
        """The videos of the walk, of which one camera's is cut or has no sound."""
        folder = self.work / name
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(self.recordings / "dev_gopro_walk" / "mp4", folder)
        folder.chmod(0o755)
        video = folder / f"{camera}.mp4"
        video.unlink()
        copy_video(self.recordings / "dev_gopro_walk" / "mp4" / video.name, video, length_s, with_sound)
        return folder


def copy_video(source: Path, target: Path, length_s: float, with_sound: bool) -> None:
    """Copy a video's packets up to a time [s], with or without its sound."""
    with av.open(str(source)) as given, av.open(str(target), "w") as made:
        kept = [given.streams.video[0], *(given.streams.audio if with_sound else ())]
        streams = {stream.index: made.add_stream_from_template(stream) for stream in kept}
        for packet in given.demux(kept):
            if packet.pts is not None and float(packet.pts * packet.time_base) < length_s:
                packet.stream = streams[packet.stream.index]
                made.mux(packet)


def played_backwards_first(source: Path, target: Path) -> Path:
    """A bag of still images whose first seconds are played backwards before it."""
    if target.exists():
        return target
    make, span_ns = recorded_messages(), round(1e9 * _BACKWARDS_S)
    with BagFile(source) as bag, write_recording(target) as writer:
        messages = list(bag.messages(bag.topics))
        start_ns = min(stamp_ns(message.header.stamp) for _, _, message in messages)
        moved = []
        for topic, _, message in messages:
            at_ns = stamp_ns(message.header.stamp) - start_ns
            times = [span_ns + at_ns, *([span_ns - at_ns] if 0 < at_ns <= span_ns else [])]
            for time_ns in times:
                header = replace(message.header, stamp=time_message(make, start_ns + time_ns))
                moved.append((start_ns + time_ns, topic, replace(message, header=header)))
        for time_ns, topic, message in sorted(moved, key=lambda each: each[:2]):
            writer.write(topic, time_ns, message)
    return target


def bodies_of_others(session: Session) -> dict[str, Path]:
    """Body files: of somebody taller, and of another day."""
    body, random = read_body(session.body), np.random.default_rng(5)

    def scaled(pose: Array) -> Array:
        return np.block([[pose[:3, :3], _TALLER * pose[:3, 3:]], [pose[3:]]])

    def moved(pose: Array) -> Array:
        shift = random.normal(size=3)
        return np.block([[pose[:3, :3], pose[:3, 3:] + _MOVED_M * shift[:, None] / np.linalg.norm(shift)], [pose[3:]]])

    joints = tuple(replace(joint, parent_T_joint=scaled(joint.parent_T_joint)) for joint in body.joints)
    taller = {c: replace(m, segment_T_camera=scaled(m.segment_T_camera)) for c, m in body.mounts.items()}
    anew = {c: replace(m, segment_T_camera=moved(m.segment_T_camera)) for c, m in body.mounts.items()}
    paths = {name: session.work / f"{name}.yaml" for name in ("taller", "strapped_anew")}
    write_body(replace(body, joints=joints, mounts=taller), paths["taller"])
    write_body(replace(body, mounts=anew), paths["strapped_anew"])
    return paths


def cases(session: Session) -> Iterator[Case]:
    """All cases, in the order of a session."""
    work, walk_videos = session.work, session.recordings / "dev_gopro_walk" / "mp4"
    yield Case("videos started by hand", ("doctor", walk_videos), 0, ("good: no problem was found",))
    short = session.videos_with("short", "head", _SHORT_S, with_sound=True)
    yield Case("a camera of half a second", ("doctor", short), 3, ("camera head: runs for",))
    deaf = session.videos_with("deaf", "head", np.inf, with_sound=False)
    # Nothing else is on its segment, so its motion does not give its clock; the other fifteen are in the bag.
    deaf_words = ("WARNING: camera head: left out: it has no sound", "--offsets")
    yield Case("a camera without sound", ("ingest", deaf, "-o", work / "deaf_bag", "--force"), 3, deaf_words)
    yield Case("a camera without sound", ("doctor", deaf), 0, ("camera head: it has no sound",))
    rom = session.bag("dev_gopro_rom")
    make = ("body", rom, "--map", session.map, "--force")
    for exchanged in (
        *((kind,) for kind in ("upper_arm", "forearm", "thigh", "shin", "foot")),
        ("upper_arm", "forearm"),
        ("thigh", "shin", "foot"),
        ("upper_arm", "forearm", "thigh", "shin", "foot"),
    ):
        words = ("wrong: cameras ", "are exchanged", *(f"{kind}_left and {kind}_right" for kind in exchanged))
        rig = session.rig_with(exchanged)
        yield Case(f"exchanged: {', '.join(exchanged)}", (*make, "--rig", rig, "-o", work / "none.yaml"), 3, words)
    backwards = played_backwards_first(SAMPLE_ROM / "bag", work / "backwards")
    sample = ("--map", SAMPLE_MAP, "--rig", SAMPLE_ROM / "rig.yaml", "-o", work / "legs.yaml", "--force")
    yield Case("motion before the N-pose", ("body", backwards, *sample), 0, ("N-pose from",))
    walk = session.bag("dev_gopro_walk")
    solve = ("replay", walk, "--map", session.map, "--force")
    yield Case("late cameras", (*solve, "--body", session.body, "-o", work / "out"), 0, ("not solved: the first",))
    part = ("--from", "3", "--to", "4.5", "-o", work / "part")
    yield Case("a part", (*solve, "--body", session.body, *part), 0, ("verdict: good",))
    for name, body in bodies_of_others(session).items():
        words = ("wrong: this is not the body of this recording",)
        yield Case(f"body: {name}", (*solve, "--body", body, "-o", work / name), 3, words)


def run(command: tuple[object, ...]) -> "subprocess.CompletedProcess[str]":
    """Run bodycam without a terminal."""
    words = [sys.executable, "-m", "bodycam_ros.cli.main", *map(str, command)]
    return subprocess.run(words, capture_output=True, text=True, check=False)


def main() -> int:
    """Run all cases, print the table; the exit code: how many are wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("recordings", "map", "work"):
        parser.add_argument(name, type=Path)
    parser.add_argument("--only", default="", help="cases with this word")
    given = parser.parse_args()
    given.work.mkdir(parents=True, exist_ok=True)
    wrong = 0
    print("| what was done | exit code | line | |\n|---|---|---|---|")
    for case in cases(Session(given.recordings, given.map, given.work)):
        if given.only not in case.done:
            continue
        ended = run(case.command)
        lines = [*ended.stdout.splitlines(), *ended.stderr.splitlines()]
        # One that is wrong prints what the person would see first.
        right = [line for line in lines if all(word in line for word in case.words)]
        first = [line for line in lines if line.startswith(_LOUD)]
        line = (right or first or lines or [""])[0].strip()
        is_right = ended.returncode == case.code and bool(right)
        wrong += not is_right
        print(f"| {case.done} | {ended.returncode} | {line[:140]} | {'right' if is_right else 'WRONG'} |", flush=True)
    return wrong


if __name__ == "__main__":
    sys.exit(main())
