"""How long the body has refused a camera, so that its registrar hears of it and searches anew.

A wrong registration is tracked from image to image and confirms itself: left out of the body it does no harm, but the
camera is of no use until somebody tells it.
"""

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Refusal:
    """A camera that the others contradicted, or the body, at every instant from one to another.

    Attributes:
        camera: name.
        since_ns: stamp of the first image that was refused [ns].
        until_ns: of the latest.
    """

    camera: str
    since_ns: int
    until_ns: int

    @property
    def lasting_s(self) -> float:
        """How long it was refused [s]."""
        return 1e-9 * (self.until_ns - self.since_ns)


class RefusalLog:
    """Counts refusals and joins them to stretches of time.

    Args:
        doubt_after_s: a camera that is refused for this long is on a wrong place, and not on its way.

    Attributes:
        counts: camera -> instants at which it was refused.
        doubts: stretches that lasted long enough, and are over, in order of their ends; for the next pass.
    """

    def __init__(self, doubt_after_s: float) -> None:
        self._doubt_after_s = doubt_after_s
        self._now: dict[str, Refusal] = {}
        self.counts: Counter[str] = Counter()
        self.doubts: list[Refusal] = []

    def add(self, stamps_ns: Mapping[str, int], refused: Collection[str]) -> None:
        """One instant: stamps [ns] of the images of registered cameras, and who of them was refused."""
        self.counts.update(refused)
        for camera in set(self._now) - set(refused):
            self._end(camera)
        for camera in refused:
            began = self._now.get(camera)
            since_ns = stamps_ns[camera] if began is None else began.since_ns
            self._now[camera] = Refusal(camera, since_ns, stamps_ns[camera])

    def end(self) -> None:
        """The recording is over, or a pause cuts what was before from what comes."""
        for camera in list(self._now):
            self._end(camera)

    @property
    def doubted(self) -> dict[str, Refusal]:
        """Cameras that have been refused for long enough by now, which their registrars should hear."""
        return {camera: said for camera, said in self._now.items() if said.lasting_s >= self._doubt_after_s}

    def _end(self, camera: str) -> None:
        over = self._now.pop(camera)
        if over.lasting_s >= self._doubt_after_s:
            self.doubts.append(over)
