"""The points of the reference map."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.messages.factory import Message, MessageFactory, flat
from bodycam_ros.messages.header import MAP_FRAME, header_message

_FLOAT32 = 7  # sensor_msgs/PointField
_FIELDS = ("x", "y", "z", "rgb")


def map_points_message(
    make: MessageFactory, stamp_ns: int, points_world: NDArray[np.floating], colours: NDArray[np.uint8]
) -> Message:
    """sensor_msgs/PointCloud2 of coloured points in the map's frame.

    Args:
        points_world: (N, 3) [m].
        colours: (N, 3) red, green, blue.
    """
    rgb = colours.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], dtype=np.uint32)
    # RViz reads a colour from the bits of a float.
    rows = np.column_stack([points_world.astype(np.float32), rgb.astype(np.uint32).view(np.float32)])
    step = 4 * len(_FIELDS)
    return make(
        "sensor_msgs/msg/PointCloud2",
        header=header_message(make, stamp_ns, MAP_FRAME),
        height=1,
        width=len(rows),
        fields=[
            make("sensor_msgs/msg/PointField", name=name, offset=4 * i, datatype=_FLOAT32, count=1)
            for i, name in enumerate(_FIELDS)
        ],
        is_bigendian=False,
        point_step=step,
        row_step=step * len(rows),
        data=make.sequence(flat(rows, np.float32).view(np.uint8)),
        is_dense=True,
    )
