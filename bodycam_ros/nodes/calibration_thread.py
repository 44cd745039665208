"""A calibration beside the executor: the body is estimated and written, unless nobody wants it any more."""

import threading
import traceback
from dataclasses import replace
from pathlib import Path

from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.body_calibrator import BodyCalibrator, CalibratedBody
from bodycam_ros.calibration.report.html_report import write_html_report
from bodycam_ros.calibration.report.report_tables import body_report
from bodycam_ros.errors import BodycamError


class _Stopped(Exception):
    """Nobody needs the result any more."""


class CalibrationThread(threading.Thread):
    """Estimates the body from what was collected until now, and writes it and its report; starts at once.

    Args:
        calibrator: may collect further in the meantime.
        path: of the body file; the report goes beside it. Both are replaced only by a body that is complete.

    Attributes:
        step, share: what it is doing and how much of that is done, 0 to 1.
        body: once the thread has ended, the body; None after an error.
        text: once the thread has ended, what to tell the user: a summary, or the error; empty if it has given up.
        defect: traceback of an error that is ours and not the user's; empty otherwise.
    """

    def __init__(self, calibrator: BodyCalibrator, path: Path) -> None:
        super().__init__(name="calibration", daemon=True)
        self._calibrator = calibrator
        self._path = path
        self._turn = threading.Lock()
        self._stopped = self._is_writing = False
        self.step, self.share = "start", 0.0
        self.body: BodyModel | None = None
        self.text = ""
        self.defect = ""
        self.start()

    def give_up(self) -> bool:
        """Let it end at its next step and write nothing; False if it is too late, for it is writing already."""
        with self._turn:
            self._stopped = not self._is_writing
            return self._stopped

    def run(self) -> None:
        """Do the work; for ``start``."""
        try:
            calibrated = self._calibrator.solve(self._path.stem, self._on_progress)
            self._on_progress("report", 0.0, is_writing=True)
            body = replace(calibrated.body, report=body_report(calibrated.diagnosis))
            write_html_report(body, calibrated.diagnosis, self._path.with_suffix(".html"))
            write_body(body, self._path)
            self.text = _summary(self._path, calibrated)
            # As the file has it, which rounds, so that a replay with the file gives the same.
            self.body = read_body(self._path)
        except BodycamError as error:
            self.text = str(error)
        except _Stopped:
            pass
        except Exception as error:
            self.text = f"the calibration broke down ({type(error).__name__}: {error}); the node's log says where"
            self.defect = traceback.format_exc()

    def _on_progress(self, step: str, share: float, is_writing: bool = False) -> None:
        with self._turn:
            if self._stopped:
                raise _Stopped
            self._is_writing = is_writing
        self.step, self.share = step, share


def _summary(path: Path, calibrated: CalibratedBody) -> str:
    diagnosis = calibrated.diagnosis
    text = f"{path} written: {len(diagnosis.joints)} joints and {len(diagnosis.cameras)} cameras"
    if diagnosis.refinement is not None:
        text += f", reprojection error {diagnosis.refinement.after_px:.2f} px"
    if diagnosis.warnings:
        text += f"; look at: {'; '.join(diagnosis.warnings)}"
    return text
