"""``python -m bodycam_ros.kernels``: compile all kernels now; part of an installation."""

import logging

from bodycam_ros.kernels.preparation import prepare_kernels

if __name__ == "__main__":
    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    prepare_kernels()
