"""The process in which Snakemake runs: its command line, with what happens to its jobs told to the process that asked.

    python -m bodycam_ros.study.engine_process DESCRIPTOR ARGUMENTS_OF_SNAKEMAKE...

Each event is a line of JSON on the descriptor, a pipe. It is Snakemake's own interface for plugins that log.
"""

# ruff: noqa: E402
import signal

signal.signal(signal.SIGINT, signal.SIG_DFL)  # until Snakemake is loaded, nothing has to be cleaned up

import json
import logging
import os
import sys
from contextlib import suppress
from types import ModuleType

from snakemake.cli import main
from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent
from snakemake_interface_logger_plugins.registry import LoggerPluginRegistry

from bodycam_ros.study.study_lock import VARIABLE, end_with_study

LOGGER = "bodycam"
_TOLD = {
    LogEvent.JOB_INFO: ("jobid", "rule_name"),
    LogEvent.JOB_FINISHED: ("job_id",),
    LogEvent.JOB_ERROR: ("jobid", "rule_msg", "log"),
}


class LogHandler(LogHandlerBase):
    """Writes events of jobs, and errors of the engine itself, to the pipe; all else to standard error."""

    writes_to_stream = True  # so that Snakemake has no handler of its own for the terminal
    writes_to_file = False
    has_filter = True
    has_formatter = False
    needs_rulegraph = False

    def emit(self, record: logging.LogRecord) -> None:
        """Tell one record."""
        event = getattr(record, "event", None)
        if event in _TOLD:
            told = {"event": str(event), **{key: getattr(record, key) for key in _TOLD[event]}}
        elif record.levelno >= logging.ERROR:
            told = {"event": "error", "text": self.format(record)}
        else:
            return
        with suppress(BrokenPipeError):  # who asked was killed; the lock that is free then ends this process
            os.write(_PIPE, json.dumps(told).encode() + b"\n")


_PIPE = int(sys.argv[1]) if __name__ == "__main__" else -1

if __name__ == "__main__":
    os.set_inheritable(_PIPE, False)
    lock = os.environ.get(VARIABLE)
    end_with_study(signal.SIGINT)  # it ends its jobs then, those in a queue as well
    if lock and "--cores" in sys.argv:  # steps on this computer; those on others cannot see the lock
        os.environ[VARIABLE] = lock
    plugin = ModuleType(LOGGER)
    plugin.LogHandler = LogHandler  # type: ignore[attr-defined]
    LoggerPluginRegistry().register_plugin(f"snakemake_logger_plugin_{LOGGER}", plugin)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        main(["--logger", LOGGER, *sys.argv[2:]])
    except KeyboardInterrupt:  # it came outside of Snakemake's own handling; who asked ends the steps
        sys.exit(128 + signal.SIGINT)
