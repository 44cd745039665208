"""TRC: virtual markers over time, in millimetres with y up, as OpenSim wants them, with a model that carries them.

A gap is crossed straight, as in MOT: OpenSim's inverse kinematics gives up at an instant without any marker. C3D leaves
it empty.
"""

from bodycam_ros.export.axes import OPENSIM_R_OURS
from bodycam_ros.export.markers import marker_places, markers_on
from bodycam_ros.export.mot import OSIM_SUFFIX
from bodycam_ros.export.options import MotionOptions
from bodycam_ros.export.osim import osim
from bodycam_ros.export.sampled_motion import SampledMotion

MARK = "PathFileType"
_TO_MM = 1000.0


def trc(motion: SampledMotion, options: MotionOptions) -> dict[str, str]:
    """The motion as a TRC file, and the model whose markers these are."""
    markers = markers_on(motion)
    count, frames = len(markers), len(motion.stamps_ns)
    places = _TO_MM * marker_places(motion, markers) @ OPENSIM_R_OURS.T
    assert motion.rate is not None  # of a format that is even
    rate = f"{motion.rate:.6f}"
    lines = [
        f"{MARK}\t4\t(X/Y/Z)\t{motion.name}.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{frames}\t{count}\tmm\t{rate}\t1\t{frames}",
        "\t".join(["Frame#", "Time", *(f"{marker.name}\t\t" for marker in markers)]),
        "\t".join(["", "", *(f"X{row}\tY{row}\tZ{row}" for row in range(1, count + 1))]),
        "",
    ]
    rows = zip(motion.seconds.tolist(), places.reshape(frames, -1).tolist(), strict=True)
    for number, (second, row) in enumerate(rows, start=1):
        shown = "\t".join(map("{:.5f}".format, row))
        lines.append(f"{number}\t{second:.9f}\t{shown}")
    return {"": "\n".join(lines) + "\n", OSIM_SUFFIX: osim(motion.body, motion.people, markers)}
