"""Files that parse and lie: values of a lens, a board, a body, equipment and points that are possible, and not true."""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from faults.work import Attempt, Make, Work

Lie = Callable[[Any], object]
"""Alters a file's content in place."""


def _told(name: str, lie: Lie, run: Callable[[Work], Attempt], must_say: str = "") -> Make:
    def make(work: Work, random: np.random.Generator) -> Attempt:
        path = work.own(name.split("/", 1)[0])
        path = work.folder / name
        _tell(path, lie)
        return dataclasses.replace(run(work), must_say=must_say)

    return make


def _tell(path: Path, lie: Lie) -> None:
    content = yaml.safe_load(path.read_text())
    lie(content)
    path.write_text(yaml.safe_dump(content, sort_keys=False))


def _scaled(factor: float, *rows: int) -> Lie:
    """Entries of the camera matrix, times a factor."""

    def lie(content: Any) -> None:
        matrix = content["camera_matrix"]["data"]
        for row in rows:
            matrix[row] *= factor

    return lie


def _distorted(*values: float) -> Lie:
    return lambda content: content["distortion_coefficients"].update(data=list(values))


def _corners(change: Callable[[Any], Any]) -> Lie:
    def lie(content: Any) -> None:
        corners = content["corners_in_board"]
        for tag in list(corners):
            corners[tag] = change(np.array(corners[tag], float)).tolist()

    return lie


def _shifted_tags(content: Any) -> None:
    corners = content["corners_in_board"]
    content["corners_in_board"] = dict(
        zip(corners, [*list(corners.values())[1:], list(corners.values())[0]], strict=True)
    )


def _joint(name: str, **fields: Any) -> Lie:
    return lambda content: content["joints"][name].update(fields)


def _mount(camera: str, key: str, value: Any) -> Lie:
    return lambda content: content["cameras"][camera].update({key: value})


def _in_millimetres(content: Any) -> None:
    for joint in content["joints"].values():
        joint["origin_in_parent"] = [1000.0 * value for value in joint["origin_in_parent"]]


def _points(change: Callable[[Any], None]) -> Lie:
    def lie(content: Any) -> None:
        for attachment in content["attachments"].values():
            for point in attachment["points"]:
                change(point)

    return lie


_MAP: Callable[[Work], Attempt] = lambda work: work.map()  # noqa: E731
_REPLAY: Callable[[Work], Attempt] = lambda work: work.replay(recording="walk")  # noqa: E731
_RIDING: Callable[[Work], Attempt] = lambda work: work.replay("--equipment", str(work.of("equipment.yaml")))  # noqa: E731
_SCORED: Callable[[Work], Attempt] = lambda work: work.evaluate(  # noqa: E731
    "--truth", str(work.of("points.trc")), "--points", str(work.of("points.yaml")), solved="walked"
)

_LENS: Mapping[str, tuple[Lie, str]] = {
    "focal lengths ten times": (_scaled(10.0, 0, 4), "(?i)camera.yaml|intrinsics"),
    "focal lengths a tenth": (_scaled(0.1, 0, 4), "(?i)camera.yaml|intrinsics"),
    "focal lengths a half more": (_scaled(1.5, 0, 4), "(?i)camera.yaml|intrinsics"),
    "one focal length twice": (_scaled(2.0, 0), "(?i)camera.yaml|intrinsics"),
    "principal point in a corner": (_scaled(0.0, 2, 5), "(?i)camera.yaml|intrinsics"),
    "distortion of another sign": (_distorted(0.3, -0.2, 0.0, 0.0, 0.0), ""),
    "a hundred times the distortion": (_distorted(-6.0, 2.5, 0.04, -0.03, 0.0), ""),
    "rows read out in 0.2 s": (lambda content: content.update(readout_time=0.2), ""),
}
_BOARD: Mapping[str, Lie] = {
    "in millimetres": _corners(lambda corners: 1000.0 * corners),
    "a hundredth": _corners(lambda corners: 0.01 * corners),
    "mirrored": _corners(lambda corners: corners * [-1.0, 1.0, 1.0]),
    "upside down": _corners(lambda corners: corners[[2, 3, 0, 1]]),
    "bent": _corners(lambda corners: corners + [0.0, 0.0, 0.3] * np.abs(corners[:, :1])),
    "in one point": _corners(lambda corners: 0.0 * corners),
    "of exchanged tags": _shifted_tags,
    "of tags that nobody sees": lambda content: content.update(
        corners_in_board={int(tag) + 300: value for tag, value in content["corners_in_board"].items()}
    ),
}
_BODY: Mapping[str, Lie] = {
    "joints in millimetres": _in_millimetres,
    "a knee in the head": _joint("knee_left", origin_in_parent=[0.0, 0.0, 1.8]),
    "bones without length": lambda content: [
        joint.update(origin_in_parent=[0.0, 0.0, 0.0]) for joint in content["joints"].values()
    ],
    "limits that are a point": _joint("hip_left", limits=[[0.0, 0.0]] * 3),
    "limits that nobody has": _joint("hip_left", limits=[[2.0, 2.5]] * 3),
}
_EQUIPMENT: Mapping[str, Lie] = {
    "points in metres": _points(lambda point: point.update(body=[0.001 * v for v in point["body"]])),
    "points a kilometre away": _points(lambda point: point.update(equipment=[1e6, 0, 0])),
    "points in one place": _points(lambda point: point.update(body=[0, 0, 0], equipment=[0, 0, 0])),
    "weights of 1e9": _points(lambda point: point.update(weight=1e9)),
    "weights of 1e-9": _points(lambda point: point.update(weight=1e-9)),
    "a crank that turns about the vertical": _joint("crank_axle", axis=[0, 0, 1]),
    "a crank of a kilometre": _joint("spindle_left", origin_in_parent=[1000.0, 0.1, 0.0]),
    "a crank known to a kilometre": _joint("spindle_left", unknown=[1e6, 0, 0]),
}
_TABLE: Mapping[str, Lie] = {
    "left for right": lambda content: content.update(
        {
            name: site.replace("left", "x").replace("right", "left").replace("x", "right")
            for name, site in content.items()
        }
    ),
    "all on the head": lambda content: content.update(dict.fromkeys(content, "head")),
    "none": lambda content: content.update(dict.fromkeys(content, None)),
    "turned round": lambda content: content.update(dict(zip(content, reversed(list(content.values())), strict=True))),
}

DAMAGES: Mapping[str, Make] = {
    **{f"lens: {what}": _told("reference/camera.yaml", lie, _MAP, says) for what, (lie, says) in _LENS.items()},
    **{f"board: {what}": _told("reference/board.yaml", lie, _MAP) for what, lie in _BOARD.items()},
    # Limits lead joints that no camera observes; what cameras observe is right in spite of them.
    **{
        f"body: {what}": _told("body.yaml", lie, _REPLAY, "" if "limits" in what else "(?i)wrong|doubtful")
        for what, lie in _BODY.items()
    },
    **{f"equipment: {what}": _told("equipment.yaml", lie, _RIDING) for what, lie in _EQUIPMENT.items()},
    **{f"points: {what}": _told("points.yaml", lie, _SCORED) for what, lie in _TABLE.items()},
}
