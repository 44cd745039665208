"""What the processes of the cameras are made of."""

import os
import subprocess
import sys


def test_a_camera_worker_loads_no_solver_and_has_one_thread_to_be_forked() -> None:
    code = (
        "import sys, os; import bodycam_ros.replay.warm_worker; "
        "print(*(name in sys.modules for name in ('bodycam_ros.registration.registrar', 'gtsam', 'matplotlib')), "
        "len(os.listdir('/proc/self/task')))"
    )
    surroundings = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=surroundings)
    assert done.stdout.split() == ["True", "False", "False", "1"], done.stderr
