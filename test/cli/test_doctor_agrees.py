"""What ``bodycam ingest`` and ``bodycam body`` refuse or doubt, ``bodycam doctor`` refuses or doubts in the same words.

Recordings are small, made here, whole and damaged; the long test takes the shared ones, if they are there.
"""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
import yaml
from helpers.altered_sample import write_altered_sample
from helpers.made_video import RATE_HZ, make_video, write_lens

from bodycam_ros.cli.main import main
from bodycam_ros.messages.factory import Message

CLAPS_S = (1.0, 4.0)
STARTS_S = {"head": 0.0, "shin": 0.4, "thigh": 0.7}
LINE = re.compile(r"(WARNING: )?(each of \d+ cameras \(.+?\)|camera [^:]+): (.+)")
CLAUSE = re.compile(r"; |, and its start cannot")


def clapped(start_s: float) -> Callable[[np.ndarray], np.ndarray]:
    """The sound of a camera that started at a time, of claps and some noise."""

    def sound(times_s: np.ndarray) -> np.ndarray:
        random = np.random.default_rng(round(1e3 * start_s))
        heard = 0.002 * random.normal(size=len(times_s))
        for seed, clap_s in enumerate(CLAPS_S):
            since_s = times_s + start_s - clap_s
            noise = np.random.default_rng(seed).normal(size=4800)
            at = np.flatnonzero(since_s >= 0.0)[: len(noise)]
            heard[at] += 0.6 * noise[: len(at)] * np.exp(-np.arange(len(at)) / 900.0)
        return np.clip(heard, -1.0, 1.0)

    return sound


def silence(times_s: np.ndarray) -> np.ndarray:
    """Digital silence."""
    return np.zeros(len(times_s))


@pytest.fixture
def videos(tmp_path: Path) -> Path:
    """Three cameras with claps."""
    folder = tmp_path / "videos"
    folder.mkdir()
    for name, start_s in STARTS_S.items():
        make_video(folder / f"{name}.mp4", frames=165, first=round(start_s * RATE_HZ), sound=clapped(start_s))
        write_lens(folder / f"{name}.yaml")
    return folder


def nothing(folder: Path) -> None:
    """Leave the recording as it is."""


def no_lens(folder: Path) -> None:
    (folder / "head.yaml").unlink()


def lens_of_another_size(folder: Path) -> None:
    write_lens(folder / "head.yaml", (640, 480))


def damaged_lens(folder: Path) -> None:
    (folder / "head.yaml").write_text("image_width: [")


def cut_off(folder: Path) -> None:
    content = (folder / "head.mp4").read_bytes()
    (folder / "head.mp4").write_bytes(content[: len(content) // 2])


def cut_off_behind_its_index(folder: Path) -> None:
    make_video(folder / "head.mp4", frames=165, sound=clapped(0.0), fast_start=True)
    cut_off(folder)


def empty(folder: Path) -> None:
    (folder / "head.mp4").write_bytes(b"")


def no_video(folder: Path) -> None:
    (folder / "head.mp4").write_text("these are notes\n")


def name_of_no_topic(folder: Path) -> None:
    (folder / "head.mp4").rename(folder / "2nd-head.mp4")


def two_of_one_name(folder: Path) -> None:
    shutil.copy(folder / "thigh.mp4", folder / "head.mov")


def no_sound(folder: Path) -> None:
    make_video(folder / "head.mp4", frames=165)


def sound_removed(folder: Path) -> None:
    """The packets of its picture alone, copied."""
    path = folder / "head.mp4"
    kept = path.rename(folder / "head.whole")
    with av.open(str(kept)) as given, av.open(str(path), "w") as made:
        stream = made.add_stream_from_template(given.streams.video[0])
        for packet in given.demux(given.streams.video[0]):
            if packet.pts is not None:
                packet.stream = stream
                made.mux(packet)
    kept.unlink()


def silent(folder: Path) -> None:
    make_video(folder / "head.mp4", frames=165, sound=silence)


def short(folder: Path) -> None:
    """Half a second, without a clap."""
    make_video(folder / "head.mp4", frames=15, sound=clapped(0.0))


def of_another_day(folder: Path) -> None:
    """It begins by its own clock when the others have ended."""
    for path in folder.glob("*.mp4"):
        path.unlink()
    for name, start_s in STARTS_S.items():
        first, sound = round(start_s * RATE_HZ), clapped(start_s)
        make_video(folder / f"{name}.mp4", frames=165, first=first, sound=sound, created="2024-05-01T12:00:00Z")
    make_video(folder / "head.mp4", frames=165, created="2024-05-01T12:10:00Z")


def images(folder: Path) -> None:
    """Images in place of a video, named by their stamps, in a folder of their own as the videos are."""
    write_images(folder, lambda n: 1_714_564_800_000_000_000 + round(1e9 * n / RATE_HZ))


def images_without_times(folder: Path) -> None:
    write_images(folder, lambda n: n)


def write_images(folder: Path, name: Callable[[int], int]) -> None:
    """Write the frames of the head's video as images; each camera has a folder then."""
    (folder / "head").mkdir()
    with av.open(str(folder / "head.mp4")) as video:
        for n, frame in enumerate(video.decode(video=0)):
            cv2.imwrite(str(folder / "head" / f"{name(n):04d}.png"), frame.to_ndarray(format="gray"))
    (folder / "head.mp4").unlink()
    for path in (*folder.glob("*.mp4"), *folder.glob("*.yaml")):
        (folder / path.stem).mkdir(exist_ok=True)
        path.rename(folder / path.stem / path.name)


def inertial_samples_in_degrees(folder: Path) -> None:
    rows = [f"{second:.3f},200,0,0,0,0,9.8" for second in np.arange(0.0, 5.0, 0.01)]
    (folder / "head.csv").write_text("\n".join(["time,gx,gy,gz,ax,ay,az", *rows]))


DAMAGES = (
    nothing, no_lens, lens_of_another_size, damaged_lens, cut_off, cut_off_behind_its_index, empty, no_video,
    name_of_no_topic, two_of_one_name, no_sound, silent, short, of_another_day, inertial_samples_in_degrees,
    images, images_without_times,
)  # fmt: skip


def ingest_lines(capsys: pytest.CaptureFixture[str], folder: Path, bag: Path) -> tuple[int, list[tuple[bool, str]]]:
    """Exit code, and what the ingest refuses (True) or doubts: the first clause of each line about a camera."""
    code = main(["ingest", str(folder), "-o", str(bag), "--force"])
    lines = [LINE.fullmatch(line.strip()) for line in capsys.readouterr().out.splitlines()]
    texts = [(bool(line[1]), line[3].removeprefix("left out: ")) for line in lines if line is not None]
    found = [(is_refused, CLAUSE.split(text)[0]) for is_refused, text in texts]
    return code, found


def doctor_findings(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, list[tuple[str, str]]]:
    """Exit code, and level and text of what is not good; the pictures made here are too small to be good."""
    code = main(["doctor", *map(str, arguments), "--json"])
    findings = json.loads(capsys.readouterr().out)["findings"]
    wrong = [f for f in findings if f["level"] != "good" and f["check"] not in ("features", "blur", "exposure")]
    return code, [(f["level"], f"{f['what']}; {f['remedy']}") for f in wrong]


def check_agreement(refused: list[tuple[bool, str]], found: list[tuple[str, str]]) -> None:
    """Everything that an ingest said, the doctor said too, and as severely.

    The doctor decodes few images, so a clock by motion is not known to it: it doubts what has none by sound.
    """
    for is_refused, clause in refused:
        if "its motion" in clause:
            continue
        levels = {level for level, text in found if clause in text}
        is_clock = "sound" in clause
        assert levels, (clause, found)
        assert not is_refused or is_clock or "wrong" in levels, (clause, found)


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.__name__)
def test_the_doctor_says_what_the_ingest_says(
    videos: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    damage: Callable[[Path], None],
) -> None:
    damage(videos)
    if damage is of_another_day:
        # Its pictures move as the others' do, and motion would put it at their time.
        monkeypatch.setattr("bodycam_ros.ingest.camera_offsets._motion", lambda *_: ({}, {}))
    code, lines = ingest_lines(capsys, videos, videos.parent / "bag")
    doctor_code, found = doctor_findings(capsys, videos)
    if damage is nothing:
        assert (code, lines, found) == (0, [], [])
        return
    assert lines, "the ingest says nothing of it"
    check_agreement(lines, found)
    if any(is_refused and "sound" not in clause for is_refused, clause in lines):
        assert (code, doctor_code) == (3, 3)


def test_a_camera_of_the_rig_that_lacks_is_named_alike_by_all(
    sample: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rom = sample / "rom"
    rig = tmp_path / "rig.yaml"
    given = yaml.safe_load((rom / "rig.yaml").read_text())
    rig.write_text(yaml.safe_dump({**given, "cameras": {**given["cameras"], "helmet": "pelvis"}}))
    body = ("body", rom / "bag", "--map", sample / "map", "--rig", rig, "-o", tmp_path / "body.yaml")
    assert main([*map(str, body)]) == 1
    error = capsys.readouterr().err
    code, found = doctor_findings(capsys, rom / "bag", "--rig", rig)
    (text,) = [text.removesuffix("; ") for level, text in found if level == "wrong"]
    assert code == 3 and f"camera helmet: {text}" in " ".join(error.split())


def test_a_lens_of_another_size_is_named_alike_in_a_bag(
    sample: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def alter(topic: str, number: int, message: Message) -> Message | None:
        if topic.endswith("/camera_info"):
            message.width, message.height = 1280, 720
        return message

    bag = write_altered_sample(sample, tmp_path / "bag", alter, frames=20)
    replay = ("replay", bag, "--map", sample / "map", "--body", sample / "body.yaml", "-o", tmp_path / "out")
    assert main([*map(str, replay)]) != 0
    printed = " ".join(" ".join(capsys.readouterr()).split())
    code, found = doctor_findings(capsys, bag)
    texts = [text.removesuffix("; ") for level, text in found if level == "wrong" and "is for 1280 x 720" in text]
    assert code == 3 and len(texts) == 3
    assert all(text in printed for text in texts)


@pytest.mark.long
@pytest.mark.parametrize("damage", [nothing, no_lens, cut_off, sound_removed], ids=lambda damage: damage.__name__)
def test_the_doctor_says_what_the_ingest_says_of_sixteen_cameras(
    shared: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], damage: Callable[[Path], None]
) -> None:
    folder = tmp_path / "videos"
    folder.mkdir()
    for path in (shared / "dev_gopro_walk" / "mp4").iterdir():
        shutil.copyfile(path, folder / path.name)
    damage(folder)
    code, lines = ingest_lines(capsys, folder, tmp_path / "bag")
    doctor_code, found = doctor_findings(capsys, folder)
    if damage is nothing:
        assert (code, lines, doctor_code, found) == (0, [], 0, [])
        return
    assert code == 3 and lines
    check_agreement(lines, found)
