"""The fault campaign: ``make faults``, or ``.venv/bin/python test/faults --help``."""

import os
import sys
from pathlib import Path

if __name__ == "__main__":
    # Before NumPy: every case has a process of its own, and threads inside would only get in the others' way.
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    sys.path[0] = str(Path(__file__).resolve().parents[1])
    from faults.campaign import main

    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit("interrupted")
