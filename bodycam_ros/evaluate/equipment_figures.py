"""How well a body was coupled to its equipment, in figures."""

from typing import Any

import numpy as np

from bodycam_ros.body.equipment_report import EquipmentRecord
from bodycam_ros.evaluate.comparison import spread

_MM_PER_M = 1000.0


def equipment_figures(record: EquipmentRecord, start_ns: int) -> dict[str, Any]:
    """Figures by name, the unit at the end of the name.

    From when on it was known where it is. Of each attachment: the share of the instants at which it held, how far its
    points were from each other while it did and while it did not, and when it did not although the equipment was
    placed, from and until, since the start [s]. Of each length that the file leaves open: what it is at last, and how
    well that is known.

    Args:
        record: of a solved recording.
        start_ns: of the recording [ns].
    """
    attachments = {}
    for column, name in enumerate(record.attachments):
        held, deviations = record.held[:, column], _MM_PER_M * record.deviations[:, column]
        attachments[name] = {
            "held": float(held.mean()),
            "deviation_mm": spread(deviations[held]),
            "apart_mm": spread(deviations[~held & record.placed]),
            "let_go_s": [[1e-9 * (stamp - start_ns) for stamp in stretch] for stretch in record.let_go(column)],
        }
    lengths = {
        name: {"value_mm": float(value), "sigma_mm": float(sigma)}
        for name, value, sigma in zip(record.lengths, _MM_PER_M * record.values, _MM_PER_M * record.sigmas, strict=True)
    }
    placed = record.stamps_ns[record.placed]
    return {
        "name": record.name,
        "placed": float(np.mean(record.placed)),
        "placed_from_s": 1e-9 * float(placed[0] - start_ns) if placed.size else None,
        "attachments": attachments,
        "lengths": lengths,
    }
