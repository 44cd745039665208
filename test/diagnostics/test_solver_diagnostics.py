"""What the solver reports on its input."""

import pytest

from bodycam_ros.diagnostics.dropped_messages import DroppedMessages
from bodycam_ros.diagnostics.solver_diagnostics import SolverDiagnostics


@pytest.mark.parametrize(("body_cameras", "text"), [(True, "no registrations arrive"), (False, "no images arrive")])
def test_what_does_not_arrive_is_what_the_cameras_in_use_send(body_cameras: bool, text: str) -> None:
    """Static cameras send images, and are registered in no map."""
    assert SolverDiagnostics(DroppedMessages(print), body_cameras).report(None)[0].text == text
