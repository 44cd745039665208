"""Whether the map is as large as the body believes: where all cameras contradict alike, the map is to blame."""

from collections.abc import Sequence

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.verdict.agreement import Agreement
from bodycam_ros.verdict.camera_link import camera_links

_EXPLAINED = 0.9
"""Share of the cameras' distances that one scale must explain."""


def map_scale(agreement: Agreement, body: BodyModel, cameras: Sequence[str]) -> float | None:
    """How many times as large as the body the map is; None if no scale explains where the cameras are.

    From one camera to another over the joint between them is as far as the body says: in the map's units that is the
    distance of their registered positions.
    """
    by_body, by_map = [], []
    for link in camera_links(body, body.mounts, cameras):
        first, second = agreement.registered(link.first), agreement.registered(link.second)
        if link.is_exact:
            first_arm = link.place(link.first, first) - first[:, :3, 3]
            second_arm = link.place(link.second, second) - second[:, :3, 3]
            by_body.append(first_arm - second_arm)
            by_map.append(second[:, :3, 3] - first[:, :3, 3])
    if not by_body:
        return None
    arms, distances = np.concatenate(by_body), np.concatenate(by_map)
    known = np.isfinite(arms).all(axis=1) & np.isfinite(distances).all(axis=1)
    arms, distances = arms[known], distances[known]
    lengths, total = float((arms**2).sum()), float((distances**2).sum())
    if lengths == 0.0 or total == 0.0:
        return None
    scale = float((arms * distances).sum()) / lengths
    rest = float(((distances - scale * arms) ** 2).sum())
    return scale if scale > 0.0 and rest < (1.0 - _EXPLAINED) * total else None
