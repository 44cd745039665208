"""What mkdocs does beside building pages: mermaid.js comes with the site, so that diagrams need no network."""

from importlib.metadata import files
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

MERMAID = "javascripts/mermaid.min.js"


def on_files(site_files: Files, config: MkDocsConfig) -> Files:
    """Add the script; Material would fetch it from a server for every reader."""
    site_files.append(File.generated(config, MERMAID, abs_src_path=str(_mermaid_path())))
    return site_files


def _mermaid_path() -> Path:
    """Path of the script in the wheel mmdc, which is not imported."""
    for path in files("mmdc") or ():
        if path.match("assets/mermaid.js"):
            return Path(str(path.locate()))
    raise PluginError("the wheel mmdc carries no assets/mermaid.js; make docs installs the version that does")
