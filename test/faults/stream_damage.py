"""Recordings that are whole, and of which something is wrong: clocks, drops, names, lenses, pictures."""

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import cv2
import numpy as np
from faults.work import WALK_CAMERAS, WALK_FRAMES, Attempt, Make, Work

from bodycam_ros.messages.factory import stamp_ns
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages

_WRONG = "waist_front"
_INFO, _IMAGE = "camera_info", "image_raw/compressed"
_DAY_NS = 86_400_000_000_000

Said = tuple[str, str, Any]
"""Camera, kind of topic, message."""

Change = Callable[[str, str, int, Any], Iterable[Said]]
"""(camera, kind of topic, number of the message on it, message) -> what is recorded instead."""


def _replay_of(change: Change, must_say: str = "", recorded: Callable[[int, int], int] = lambda row, ns: ns) -> Make:
    def make(work: Work, random: np.random.Generator) -> Attempt:
        source, target = work.stock / "walk", work.folder / "recording"
        counts: dict[str, int] = {}
        with BagFile(source) as bag, write_recording(target) as writer:
            for row, (topic, recorded_ns, message) in enumerate(bag.messages(bag.topics)):
                camera, kind = topic[1:].split("/", 1)
                number = counts[topic] = counts.get(topic, -1) + 1
                for new_camera, new_kind, new in change(camera, kind, number, message):
                    writer.write(f"/{new_camera}/{new_kind}", recorded(row, recorded_ns), new)
        return dataclasses.replace(work.replay(), must_say=must_say)

    return make


def _stamped(stamp: Callable[[str, int, int], int], must_say: str = "") -> Make:
    """Images with other stamps: (camera, number, stamp [ns]) -> stamp [ns]."""

    def change(camera: str, kind: str, number: int, message: Any) -> Iterable[Said]:
        if kind != _INFO:
            seconds, nanoseconds = divmod(stamp(camera, number, stamp_ns(message.header.stamp)), 1_000_000_000)
            time = dataclasses.replace(message.header.stamp, sec=seconds, nanosec=nanoseconds)
            message = dataclasses.replace(message, header=dataclasses.replace(message.header, stamp=time))
        yield camera, kind, message

    return _replay_of(change, must_say)


def _of_one(by: Callable[[int], int]) -> Callable[[str, int, int], int]:
    """Stamps of one camera, shifted by so much at the image of a number [ns]."""
    return lambda camera, number, ns: ns + by(number) if camera == _WRONG else ns


def _kept(keep: Callable[[str, int], bool], must_say: str = "") -> Make:
    """Some of the images: (camera, number) -> whether it is recorded."""

    def change(camera: str, kind: str, number: int, message: Any) -> Iterable[Said]:
        if kind == _INFO or keep(camera, number):
            yield camera, kind, message

    return _replay_of(change, must_say)


def _pictured(
    picture: Callable[[Any, int], bytes], must_say: str = _WRONG, since: int = 0, until: int = WALK_FRAMES
) -> Make:
    """Other pictures of one camera: (decoded picture, number) -> file."""

    def change(camera: str, kind: str, number: int, message: Any) -> Iterable[Said]:
        if kind == _IMAGE and camera == _WRONG and since <= number < until:
            content = picture(cv2.imdecode(message.data, cv2.IMREAD_GRAYSCALE), number)
            message = dataclasses.replace(message, data=np.frombuffer(content, np.uint8))
        yield camera, kind, message

    return _replay_of(change, must_say)


def _informed(must_say: str = _WRONG, since: int = 0, **fields: Any) -> Make:
    """Another camera_info of one camera; a function makes a field of what it was."""

    def change(camera: str, kind: str, number: int, message: Any) -> Iterable[Said]:
        if kind == _INFO and camera == _WRONG and number >= since:
            new = {name: value(getattr(message, name)) if callable(value) else value for name, value in fields.items()}
            message = dataclasses.replace(message, **new)
        yield camera, kind, message

    return _replay_of(change, must_say)


def _named(names: Mapping[str, str], must_say: str = "") -> Make:
    return _replay_of(lambda camera, kind, number, message: [(names.get(camera, camera), kind, message)], must_say)


def _raw(**fields: Any) -> Make:
    """One camera's images uncompressed, with wrong fields."""
    make = recorded_messages()

    def change(camera: str, kind: str, number: int, message: Any) -> Iterable[Said]:
        if kind == _INFO or camera != _WRONG:
            return [(camera, kind, message)]
        grey = cv2.imdecode(message.data, cv2.IMREAD_GRAYSCALE)
        rows, columns = grey.shape
        sound = {"height": rows, "width": columns, "encoding": "mono8", "is_bigendian": 0, "step": columns}
        sound["data"] = np.ascontiguousarray(grey).reshape(-1)
        image = make("sensor_msgs/msg/Image", header=message.header, **(sound | fields))
        return [(camera, "image_raw", image)]

    return _replay_of(change, _WRONG)


def _jpeg(picture: Any) -> bytes:
    return cv2.imencode(".jpg", picture)[1].tobytes()


def _claims_60000_square(picture: Any, number: int) -> bytes:
    """A JPEG whose header claims 60000 by 60000 pixels."""
    content = bytearray(_jpeg(picture))
    at = content.index(b"\xff\xc0")
    content[at + 5 : at + 9] = b"\xea\x60\xea\x60"
    return bytes(content)


def _noise(picture: Any, number: int) -> bytes:
    return _jpeg(np.random.default_rng(number).integers(0, 255, picture.shape, dtype=np.uint8))


def _focal(factor: float) -> Callable[[Any], Any]:
    return lambda k: np.asarray(k) * np.array([factor, 1, 1, 1, factor, 1, 1, 1, 1])


_WHO = f"(?i){_WRONG}|wrong|doubtful"

DAMAGES: Mapping[str, Make] = {
    "nothing": _kept(lambda camera, number: True),
    "clock 10 ms off": _stamped(_of_one(lambda number: 10_000_000), _WHO),
    "clock an hour off": _stamped(_of_one(lambda number: 3_600_000_000_000), _WHO),
    "clock an hour behind": _stamped(_of_one(lambda number: -3_600_000_000_000), _WHO),
    "clock drifts by 1 %": _stamped(_of_one(lambda number: 333_333 * number)),
    "clock jumps back": _stamped(_of_one(lambda number: -400_000_000 if number > 15 else 0), _WHO),
    "all clocks jump back": _stamped(lambda camera, number, ns: ns - (2_000_000_000 if number > 15 else 0), "stamp"),
    # Stamps by the cameras' own clocks go on; half of the messages were recorded a second before those before them.
    "the recorder's clock is set back": _replay_of(
        lambda camera, kind, number, message: [(camera, kind, message)],
        recorded=lambda row, ns: ns - (1_000_000_000 if row > 4 * WALK_FRAMES else 0),
    ),
    "the recorder's clock at random": _replay_of(
        lambda camera, kind, number, message: [(camera, kind, message)],
        recorded=lambda row, ns: ns + int(np.random.default_rng(row).integers(10**9)),
    ),
    "one stamp of tomorrow": _stamped(_of_one(lambda number: _DAY_NS if number == 12 else 0), _WHO),
    "all stamps 0": _stamped(lambda camera, number, ns: 0, "stamp"),
    "stamps of a camera 0": _stamped(lambda camera, number, ns: 0 if camera == _WRONG else ns, _WHO),
    "stamps below 0": _stamped(lambda camera, number, ns: ns - 2_000_000_000_000_000_000, "stamp"),
    "stamps of 1970": _stamped(lambda camera, number, ns: ns % 1_000_000_000),
    "images missing here and there": _kept(lambda camera, number: (number * 7 + len(camera)) % 5 > 0),
    "every third image": _kept(lambda camera, number: number % 3 == 0),
    "a camera without images": _kept(lambda camera, number: camera != _WRONG, _WHO),
    "a camera ends early": _kept(lambda camera, number: camera != _WRONG or number < 8, _WHO),
    "a camera starts late": _kept(lambda camera, number: camera != _WRONG or number > 20),
    "all cameras pause": _kept(lambda camera, number: not 10 <= number < 20),
    "one image a camera": _kept(lambda camera, number: number == 0),
    "one image": _kept(lambda camera, number: number == 0 and camera == _WRONG),
    "no images": _kept(lambda camera, number: False),
    "one camera": _kept(lambda camera, number: camera == _WRONG),
    "names exchanged": _named({"waist_front": "thigh_left", "thigh_left": "waist_front"}, "(?i)waist_front|thigh_left"),
    "names of the far end exchanged": _named({"waist_front": "shin_left", "shin_left": "waist_front"}, "(?i)waist_fr"),
    "nobody's names": _named({camera: f"cam{number}" for number, camera in enumerate(WALK_CAMERAS)}),
    "grey": _pictured(lambda picture, number: _jpeg(picture * 0 + 128)),
    "grey for a while": _pictured(lambda picture, number: _jpeg(picture * 0 + 128), "", 8, 20),
    "black": _pictured(lambda picture, number: _jpeg(picture * 0)),
    "noise": _pictured(_noise),
    "upside down": _pictured(lambda picture, number: _jpeg(picture[::-1, ::-1])),
    "mirrored": _pictured(lambda picture, number: _jpeg(picture[:, ::-1])),
    "half the size": _pictured(lambda picture, number: _jpeg(picture[::2, ::2])),
    "one pixel": _pictured(lambda picture, number: _jpeg(picture[:1, :1])),
    "the first picture for ever": _pictured(lambda picture, number: _jpeg(picture), "", 0, 1),
    "cut pictures": _pictured(lambda picture, number: _jpeg(picture)[:900]),
    "empty pictures": _pictured(lambda picture, number: b""),
    "pictures that claim 60000 by 60000": _pictured(_claims_60000_square),
    "text for pictures": _pictured(lambda picture, number: b"<html>not found</html>"),
    "lens of another model": _informed(distortion_model="plumb_bob", d=np.zeros(5)),
    "lens unknown": _informed(distortion_model="mystery"),
    "focal length a fifth too long": _informed(k=_focal(1.2)),
    "focal length 0": _informed(k=np.zeros(9)),
    "focal length NaN": _informed(k=lambda k: np.asarray(k) * np.nan),
    "focal length negative": _informed(k=_focal(-1.0)),
    "distortion absurd": _informed(d=np.array([1e9, -1e9, 1e9, -1e9])),
    "distortion of no numbers": _informed(d=np.zeros(0)),
    "camera_info of another size": _informed(width=320, height=240),
    "camera_info of absurd size": _informed(width=2**31, height=2**31),
    "camera_info of size 0": _informed(width=0, height=0),
    "camera_info twice, not the same": _informed("", 1, k=_focal(1.5)),
    "no camera_info": _replay_of(lambda c, kind, n, m: [] if (kind, c) == (_INFO, _WRONG) else [(c, kind, m)], _WRONG),
    "raw of unknown encoding": _raw(encoding="klingon8"),
    "raw with less data": _raw(data=np.zeros(100, np.uint8)),
    "raw with a step of 1": _raw(step=1),
    "raw of absurd height": _raw(height=2**31),
    "raw of height 0": _raw(height=0),
    "raw with a name of escapes": _raw(encoding="\x1b[31mred"),
}
