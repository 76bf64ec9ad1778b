"""Hooks of MkDocs: the repository's Markdown, as GitHub shows it, on the documentation site."""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Final

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT: Final = Path(__file__).parents[2]
PAGES: Final = {
    "index.md": "README.md",
    "changelog.md": "CHANGELOG.md",
    "contributing.md": "CONTRIBUTING.md",
    "paper.md": "results/drives-paper/notes.md",
}
"""Pages whose source is elsewhere in the repository, each with its source."""

_PLACES: Final = {source: page for page, source in PAGES.items()} | {"docs/README.md": "index.md"}
_FENCED: Final = re.compile(r"(^ *```.*?^ *```$)", re.MULTILINE | re.DOTALL)
_TARGET: Final = re.compile(r"(?<=\]\()(?![a-z]+:|#)[^)#\s]+")
_LIST_BELOW_TEXT: Final = re.compile(r"^((?![-*+] |\d+\. |[ #|<]).+\n)(?=- |1\. )", re.MULTILINE)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages from elsewhere."""
    for page, source in PAGES.items():
        files.append(File.generated(config, page, abs_src_path=str(ROOT / source)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links into those of the site; a list may follow its introduction at once, as on GitHub."""
    here = page.file.src_uri
    source = PAGES.get(here, f"docs/{here}")

    def target(match: re.Match[str]) -> str:
        path = posixpath.normpath(posixpath.join(posixpath.dirname(source), match[0]))
        place = _PLACES.get(path, path.removeprefix("docs/"))
        if path.endswith(".png") and files.get_file_from_path(place) is None:
            files.append(File.generated(config, place, abs_src_path=str(ROOT / path)))
        if files.get_file_from_path(place) is None and (ROOT / path).exists():
            return f"{config.extra['repository']}/{'tree' if (ROOT / path).is_dir() else 'blob'}/main/{path}"
        return posixpath.relpath(place, posixpath.dirname(here))

    parts = _FENCED.split(markdown)
    parts[::2] = [_LIST_BELOW_TEXT.sub(r"\1\n", _TARGET.sub(target, part)) for part in parts[::2]]
    return "".join(parts)
