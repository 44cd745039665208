"""What can go wrong for a user, as one tree of exceptions.

Every message names the file, topic or camera, what was expected, what came and what to do about it.
The command line and the nodes print the message alone; a traceback means a defect of ours.
"""


class BodycamError(Exception):
    """Base of all errors that a user can mend.

    Attributes:
        camera: that it is about, if its message begins with one.
        cause: the message without the camera, for a report that names cameras itself.
    """

    def __init__(self, cause: str, camera: str = "") -> None:
        super().__init__(f"camera {camera}: {cause}" if camera else cause)
        self.camera, self.cause = camera, cause


class SettingsError(BodycamError):
    """A setting is unknown, of the wrong type or out of its range."""


class KernelError(BodycamError):
    """The compiled kernels are missing, older than the package, or cannot be loaded."""


class LensError(BodycamError):
    """A camera's intrinsics are missing, malformed or of an unsupported model."""


class RecordingError(BodycamError):
    """A bag, video or image file cannot be read, or lacks what a stage needs."""


class MapError(BodycamError):
    """A reference map cannot be built, loaded or used."""


class BodyError(BodycamError):
    """A body description is malformed or does not fit the recording."""


class RangeOfMotionError(BodyError):
    """A range of motion does not determine a body; the message names the joint, and what to repeat."""


class RigError(RangeOfMotionError):
    """Cameras are on other segments than the rig says; the message names them."""


class StaticCameraError(BodycamError):
    """Where static cameras stand is malformed, or cannot be found out."""


class StudyError(BodycamError):
    """A study file is malformed, or its workflow cannot be run."""


class OutputError(BodycamError):
    """A file or folder cannot be written."""


class ViewError(BodycamError):
    """The view in a browser cannot be served."""
