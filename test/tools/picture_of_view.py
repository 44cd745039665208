"""Makes docs/view.png: the view of the sample in a headless Chromium.

python test/tools/picture_of_view.py OUT BODY.yaml -o docs/view.png     (OUT: bags/sample/bag, replayed)
"""

import argparse
import sys
import time
from pathlib import Path

from PIL import Image

sys.path.insert(0, str(Path(__file__).parent.parent))
from view_in_browser import REPOSITORY, BrowserView, find_chromium, served  # noqa: E402

WINDOW = (1490, 930)
SECONDS = "0.5"
IMAGE = "waist_left"
SETTLES_S = 6.0  # a software renderer sharpens the picture when nothing moves any more


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("solved", type=Path)
    parser.add_argument("body", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    chromium = find_chromium()
    if chromium is None:
        parser.error("there is no Chromium on this machine: apt-get install chromium")
    sample = REPOSITORY / "bags"
    given = ["--map", sample / "map", "--recording", sample / "sample" / "bag"]
    with (
        served(arguments.solved.resolve(), "--body", arguments.body.resolve(), *given) as running,
        BrowserView.opened(running.address, chromium, WINDOW) as view,
    ):
        view.enter("seconds", SECONDS)
        view.choose("camera", IMAGE)
        view.page.get_by_text("px off (median)").wait_for()
        view.page.mouse.move(WINDOW[0] / 4, WINDOW[1] - 5)
        time.sleep(SETTLES_S)
        pixels = view.picture()

    Image.fromarray(pixels).save(arguments.output, optimize=True)


if __name__ == "__main__":
    main()
