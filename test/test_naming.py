"""The check of what a message names: whole things alone count."""

import pytest
from helpers.naming import names, naming, numbers


@pytest.mark.parametrize(
    ("text", "thing", "is_named"),
    [
        ("camera head: no image", "camera head", True),
        ("camera left_knee: no image", "left", False),
        ("camera left_knee: no image", "knee", False),
        ("cannot read '/bags/map/map.yaml'", "map.yaml", True),
        ("cannot read /bags/map.yaml.bak", "map.yaml", False),
        ("cannot read /bags/road_map.yaml", "map.yaml", False),
        ("no message on /right/camera_info", "/right/camera_info", True),
        ("no message on /bright/camera_info", "/right/camera_info", False),
        ("choose another name, or --force", "--force", True),
        ("line 51: too deep", 5, False),
        ("12.5 s at most", 12.5, True),
        ("12.5 s at most", 5, False),
        ("12.5 s at most", 12, False),
        ("points[1].weight", "points[1].weight", True),
    ],
)
def test_a_thing_is_named_as_a_whole(text: str, thing: object, is_named: bool) -> None:
    assert names(text, thing) == is_named


def test_numbers_of_a_text_are_read_and_digits_of_names_are_not() -> None:
    assert numbers("take_2: off by -0.5 mm, 3 deg and 1e-3 s; camera GH010001, (12) 7") == [-0.5, 3.0, 1e-3, 12.0, 7.0]


def test_a_message_that_lacks_a_thing_fails() -> None:
    with naming(ValueError, "camera head", 3) as caught:
        raise ValueError("camera head: 3 images")
    assert caught.type is ValueError
    with pytest.raises(AssertionError) as failed, naming(ValueError, "camera head", "foot"):
        raise ValueError("camera head: 3 images")
    assert names(str(failed.value), "foot") and names(str(failed.value), "camera head")
    with pytest.raises(pytest.fail.Exception), naming(ValueError, "camera head"):
        pass
    with pytest.raises(KeyError), naming(ValueError, "camera head"):
        raise KeyError("camera head")
