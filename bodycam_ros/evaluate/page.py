"""A page of sections, as one HTML file that fetches and runs nothing.

The reports of a body, of a recording and of a study are such pages; ``page.html.jinja`` is their one template.
"""

from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from bodycam_ros.evaluate.sections import Page
from bodycam_ros.picture_style import FAINT, INK, QUIET, WARNING

_TEMPLATE = "page.html.jinja"


def render_page(page: Page) -> str:
    """The page as an HTML 5 document."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=StrictUndefined,
    )
    colours = {"ink": INK, "quiet": QUIET, "faint": FAINT, "warning": WARNING}
    return environment.get_template(_TEMPLATE).render(page=page, **colours)
