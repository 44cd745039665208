"""The picture of the documentation is what the code draws: sound of sixteen cameras, made, before and after.

BODYCAM_DOCS=1 pytest test/ingest/test_picture_in_docs.py     writes it anew
"""

import os
import shutil
from pathlib import Path

import cv2
import numpy as np
from clapped_sound import Recorder, sources

from bodycam_ros.ingest.camera_offsets import camera_times
from bodycam_ros.ingest.timing_picture import draw_timing

PICTURE = Path(__file__).parents[2] / "docs/sound.png"
LIMBS = {"upper_arm": 0.45, "forearm": 0.3, "thigh": 0.7, "shin": 1.05, "foot": 1.35}
WAYS_M = {"waist_front": 0.4, "waist_left": 0.5, "waist_right": 0.5, "torso_front": 0.3, "torso_back": 0.6, "head": 0.5}


def test_the_picture_in_the_docs_is_what_is_drawn(tmp_path: Path) -> None:
    ways = WAYS_M | {f"{limb}_{side}": way for side in ("left", "right") for limb, way in LIMBS.items()}
    random = np.random.default_rng(8)
    starts, drifts = random.uniform(-3.0, 0.0, len(ways)), random.normal(0.0, 20e-6, len(ways))
    recorders = {
        name: Recorder(
            float(starts[n]),
            20.0 + float(random.uniform(0.0, 2.0)),
            float(drifts[n]),
            way,
            gain=float(random.uniform(0.4, 1.2)),
            noise=float(random.uniform(0.003, 0.012)),
            own=tuple(random.uniform(2.0, 18.0, random.integers(0, 3)).tolist()),
        )
        for n, (name, way) in enumerate(ways.items())
    }
    recorders["foot_right"] = Recorder(1.6, 20.9, way_m=1.35, own=(5.2,))  # started after the first clap
    bounces = {6.0 + 0.61 * n + 0.03 * np.sin(3.0 * n): 0.12 for n in range(9)}
    offsets = camera_times(sources(recorders, {1.2: 0.8, 19.0: 0.9} | bounces))
    assert set(offsets.times) == set(recorders)

    drawn = tmp_path / PICTURE.name
    draw_timing(offsets, drawn)
    if os.environ.get("BODYCAM_DOCS"):
        shutil.copyfile(drawn, PICTURE)
    fresh, kept = cv2.imread(str(drawn)), cv2.imread(str(PICTURE))
    assert kept is not None and fresh is not None
    assert fresh.shape == kept.shape
    assert np.abs(fresh.astype(float) - kept).mean() < 2.0  # of 255; type and colours alone differ by less
