from pathlib import Path

import cv2
import numpy as np

from bodycam_ros.lens.lens_pictures import lens_pictures


def test_pictures_of_two_folders_have_names_of_their_own_and_count_once(tmp_path: Path) -> None:
    """What is known of a picture is found again by its name."""
    for number, folder in enumerate(("near", "far")):
        (tmp_path / folder).mkdir()
        for image in range(2):
            grey = np.full((12, 16), 100 * number + 10 * image, np.uint8)
            cv2.imwrite(str(tmp_path / folder / f"{image}.png"), grey)
    cv2.imwrite(str(tmp_path / "far" / "alone.png"), np.full((12, 16), 222, np.uint8))
    pictures = lens_pictures([tmp_path / "near", tmp_path / "far", tmp_path / "far" / "0.png", tmp_path / "near"], 120)
    shades = {picture.name: int(picture.grey[0, 0]) for picture in pictures}
    assert len(pictures) == len(shades) == 5
    assert shades["alone.png"] == 222
    assert shades[str(tmp_path / "near" / "1.png")] == 10
    assert shades[str(tmp_path / "far" / "1.png")] == 110
