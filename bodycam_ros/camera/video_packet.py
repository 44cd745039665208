"""One frame of a video as it is in a bag: compressed, and of use only to who has the frames before it."""

from dataclasses import dataclass
from functools import cached_property

_START_CODE = b"\x00\x00\x01"
_H264_SLICES, _H264_KEY = range(1, 6), {5, 7}  # an IDR slice, or the sequence's parameters before an intra frame
_HEVC_SLICES, _HEVC_KEY = range(0, 32), {*range(16, 22), 33}


@dataclass(frozen=True)
class VideoPacket:
    """What decodes to exactly one frame, once the frames since the last keyframe were decoded.

    Attributes:
        codec: "h264" or "hevc".
        data: NAL units in the form of Annex B; with a keyframe the stream's parameters.
    """

    codec: str
    data: bytes

    @cached_property
    def is_key(self) -> bool:
        """Whether decoding can begin here."""
        hevc = self.codec == "hevc"
        slices, key = (_HEVC_SLICES, _HEVC_KEY) if hevc else (_H264_SLICES, _H264_KEY)
        at = self.data.find(_START_CODE)
        while 0 <= at < len(self.data) - 3:
            header = self.data[at + 3]
            kind = header >> 1 & 0x3F if hevc else header & 0x1F
            if kind in key:
                return True
            if kind in slices:
                return False
            at = self.data.find(_START_CODE, at + 3)
        return False
