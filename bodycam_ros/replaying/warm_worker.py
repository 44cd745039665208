"""What every camera worker needs, loaded once: workers are forked from a process that imports this and does no more.

So a worker starts at once, and shares the memory of libraries and kernels with the others.
"""

# ruff: noqa: E402
import os

# The processes share the cores; more threads of the linear algebra, which is loaded below, would compete.
os.environ.update(dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import gc

import cv2

import bodycam_ros.registration.relocalisation  # noqa: F401
from bodycam_ros.kernels import load_kernels
from bodycam_ros.recording.typestore import recording_typestore

cv2.setNumThreads(1)  # threads do not survive a fork
load_kernels()
recording_typestore()
gc.freeze()  # a collection would write to all that is shared
