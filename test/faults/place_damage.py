"""Inputs and outputs in bad places: pipes, holes, full disks, other people's folders, names that no text can say."""

import dataclasses
import os
import socket
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from faults.work import Attempt, Make, Work

Command = Callable[..., Attempt]

_OUTPUTS: Mapping[str, Callable[[Work, Path], Attempt]] = {
    "replay": lambda work, out: work.replay(out=out),
    "replay --force": lambda work, out: work.replay("--force", out=out),
    "body": lambda work, out: work.body(out=out),
    "body --force": lambda work, out: work.body("--force", out=out),
    "map": lambda work, out: work.map(out=out),
    "map --force": lambda work, out: work.map("--force", out=out),
    "evaluate": lambda work, out: work.evaluate(out=out),
    "export": lambda work, out: work.export(out=out),
    "export body": lambda work, out: work.export("body.yaml", out=out),
}
_INPUTS: Mapping[str, tuple[str, Callable[[Work], Attempt]]] = {
    "recording": ("recording/recording.mcap", lambda work: work.replay()),
    "metadata": ("recording/metadata.yaml", lambda work: work.replay()),
    "map.yaml": ("map/map.yaml", lambda work: work.replay()),
    "landmarks.npz": ("map/landmarks.npz", lambda work: work.replay()),
    "body.yaml": ("body.yaml", lambda work: work.replay()),
    "body.urdf": ("body.urdf", lambda work: work.replay(body="body.urdf")),
    "rig.yaml": ("rig.yaml", lambda work: work.body()),
    "settings.yaml": ("settings.yaml", lambda work: work.replay("--config", str(work.of("settings.yaml")))),
    "camera.yaml": ("reference/camera.yaml", lambda work: work.map()),
    "board.yaml": ("reference/board.yaml", lambda work: work.map()),
    "photograph": ("reference/ref_0101.jpg", lambda work: work.map()),
    "solved": ("solved/solved.mcap", lambda work: work.evaluate()),
    "exported": ("body.yaml", lambda work: work.export("body.yaml")),
    "truth": ("truth/truth/segments/head.tum", lambda work: work.evaluate("--truth", str(work.of("truth")))),
}


def _is_pipe(path: Path) -> None:
    os.mkfifo(path)


def _is_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as end:
        end.bind(os.path.relpath(path))


def _is_unreadable(path: Path) -> None:
    path.write_bytes(b"secret")
    path.chmod(0)


_STATES: Mapping[str, Callable[[Path], object]] = {
    "missing": lambda path: None,
    "a pipe": _is_pipe,
    "a socket": _is_socket,
    "a folder": lambda path: path.mkdir(),
    "a link to nothing": lambda path: path.symlink_to("nothing"),
    "a link to itself": lambda path: path.symlink_to(path.name),
    "the zero device": lambda path: path.symlink_to("/dev/zero"),
    "unreadable": _is_unreadable,
}


def _input_that(state: Callable[[Path], object], name: str, run: Callable[[Work], Attempt]) -> Make:
    def make(work: Work, random: np.random.Generator) -> Attempt:
        work.own(name.split("/", 1)[0])
        path = work.folder / name
        path.unlink()
        state(path)
        return dataclasses.replace(run(work), ordinary_user=True)

    return make


def _foreign_folder(folder: Path) -> Path:
    place = folder / "thesis"
    place.mkdir()
    (place / "thesis.txt").write_text("precious")
    return place


def _read_only(folder: Path) -> Path:
    place = folder / "read_only"
    place.mkdir()
    place.chmod(0o555)
    return place / "out"


def _file(folder: Path) -> Path:
    (folder / "file").write_text("precious")
    return folder / "file"


def _linked(folder: Path, target: str) -> Path:
    (folder / "link").symlink_to(target)
    return folder / "link"


def _piped(folder: Path) -> Path:
    os.mkfifo(folder / "pipe")
    return folder / "pipe"


_PLACES: Mapping[str, Callable[[Path], Path]] = {
    "/dev/null": lambda folder: Path("/dev/null"),
    "/dev/full": lambda folder: Path("/dev/full"),
    "the root folder": lambda folder: Path("/"),
    "the folder itself": lambda folder: Path("."),
    "a suffix alone": lambda folder: folder / ".xml",
    "two dots": lambda folder: folder / "..",
    "no name": lambda folder: Path(""),
    "a name of 300 letters": lambda folder: folder / ("x" * 300),
    "a path of 6000 letters": lambda folder: folder / "/".join(["x" * 100] * 60),
    "a name that is not UTF-8": lambda folder: folder / os.fsdecode(b"\xff\xfeout"),
    "a name of escapes": lambda folder: folder / "\x1b[31mred",
    "a foreign folder": _foreign_folder,
    "a file": _file,
    "beneath a file": lambda folder: _file(folder) / "out",
    "a folder without rights": _read_only,
    "a folder that is not there": lambda folder: folder / "nowhere" / "out",
    "a link to nothing": lambda folder: _linked(folder, "nothing"),
    "a link to itself": lambda folder: _linked(folder, "link"),
    "a pipe": _piped,
}
_INPUT_AS_OUTPUT = {
    "replay --force": ("recording", "map", "body.yaml", "recording/out", "map/out", "recording/recording.mcap"),
    "body --force": ("rig.yaml", "recording", "map", "recording/metadata.yaml", "rig.html"),
    "map --force": ("reference", "reference/out", "reference/camera.yaml"),
    "evaluate": ("solved", "solved/report", "solved/metadata.yaml"),
    "export": ("solved", "solved/solved.mcap"),
    "export body": ("body.yaml",),
}


def _output_at(place: Callable[[Path], Path], command: str) -> Make:
    def make(work: Work, random: np.random.Generator) -> Attempt:
        out = place(work.folder)
        return dataclasses.replace(_OUTPUTS[command](work, out), ordinary_user=True)

    return make


def _output_on_input(command: str, name: str) -> Make:
    def make(work: Work, random: np.random.Generator) -> Attempt:
        for own in ("recording", "map", "body.yaml", "rig.yaml", "reference", "solved"):
            work.own(own)
        attempt = _OUTPUTS[command](work, work.folder / name)
        return dataclasses.replace(attempt, outputs={p: k for p, k in attempt.outputs.items() if "/out" in name})

    return make


def _full_disk(command: str) -> Make:
    """The disk takes a part of what is to be written, and no more; what was there before is to stay."""

    def make(work: Work, random: np.random.Generator) -> Attempt:
        attempt = _OUTPUTS[command](
            work, work.folder / "out.yaml" if command.startswith("body") else work.folder / "out"
        )
        return dataclasses.replace(attempt, largest_file=int(2 ** random.uniform(4, 16)))

    return make


DAMAGES: Mapping[str, Make] = {
    **{
        f"{what} is {state}": _input_that(_STATES[state], name, run)
        for what, (name, run) in _INPUTS.items()
        for state in _STATES
    },
    **{f"{command} to {place}": _output_at(_PLACES[place], command) for place in _PLACES for command in _OUTPUTS},
    **{f"{c} onto {name}": _output_on_input(c, name) for c, names in _INPUT_AS_OUTPUT.items() for name in names},
    **{f"{command} to a full disk": _full_disk(command) for command in _OUTPUTS},
}
