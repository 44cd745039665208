"""The site is built without a warning, and can be read without a network."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("material", reason="the site is built by mkdocs-material, which `make docs` installs")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_every_page_is_in_it(site: Path) -> None:
    pages = {path.stem for path in (REPOSITORY / "docs").glob("*.md")}
    assert pages <= {path.stem for path in site.glob("*.html")}


def test_no_page_fetches_anything(site: Path) -> None:
    """Links may lead elsewhere; scripts, styles, fonts and pictures come with the site."""
    for page in site.glob("*.html"):
        text = page.read_text()
        fetched = re.findall(r'<(?:script|img)\b[^>]*\bsrc="([^"]+)"', text)
        fetched += re.findall(r'<link\b[^>]*\brel="(?:stylesheet|preload|icon|preconnect)"[^>]*\bhref="([^"]+)"', text)
        fetched += re.findall(r'<link\b[^>]*\bhref="([^"]+)"[^>]*\brel="(?:stylesheet|preload|icon|preconnect)"', text)
        assert [url for url in fetched if "//" in url] == [], page.name
        assert len(fetched) > 2, page.name


def test_diagrams_come_with_their_script(site: Path) -> None:
    page = (site / "architecture.html").read_text()
    assert '<pre class="mermaid">' in page and 'src="javascripts/mermaid.min.js"' in page
    assert 'globalThis["mermaid"]' in (site / "javascripts/mermaid.min.js").read_text()
