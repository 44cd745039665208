"""Reads the images of the camera that a person chose, without keeping the view waiting."""

import threading
from collections.abc import Callable
from pathlib import Path

from bodycam_ros.errors import BodycamError
from bodycam_ros.view.footage import Footage, read_footage
from bodycam_ros.view.inbox import Inbox


class FootageLoader:
    """Reads one camera at a time; of several that are asked for in a row, the last.

    Attributes:
        footage: of the camera asked for, once it is there.
    """

    def __init__(
        self,
        recording: Path,
        solved: Path | None,
        inbox: Inbox,
        on_loaded: Callable[[], None],
        on_error: Callable[[BodycamError], None],
    ) -> None:
        self.footage: Footage | None = None
        self._recording = recording
        self._solved = solved
        self._inbox = inbox
        self._on_loaded = on_loaded
        self._on_error = on_error
        self._wanted: str | None = None

    def ask(self, camera: str | None) -> None:
        """Begin to read a camera, or forget them all."""
        if camera == self._wanted:
            return
        self._wanted, self.footage = camera, None
        if camera is not None:
            threading.Thread(target=self._read, args=(camera,), daemon=True).start()

    def _read(self, camera: str) -> None:
        try:
            footage = read_footage(self._recording, self._solved, camera, lambda: self._wanted == camera)
        except BodycamError as error:
            failed = error
            self._inbox.put(lambda: self._on_error(failed))
            return
        if footage is not None:
            self._inbox.put(lambda: self._loaded(footage))

    def _loaded(self, footage: Footage) -> None:
        if footage.camera == self._wanted:
            self.footage = footage
            self._on_loaded()
