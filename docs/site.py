"""What the site takes from outside of docs: the changelog, how to contribute, the benchmarks'
results; the commands' page.

Pages are written to be read in the repository as well, so links between them lead through the
repository's folders. When the site is built, a link that leads to a file of the site is made to
lead there.
"""

import posixpath
import re
from pathlib import Path, PurePosixPath

import commands
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
LINK = re.compile(r"(\]\()([^)#:\s]+)(#[^)\s]*)?(\))")


def taken() -> dict[str, str]:
    """Return where files from outside of docs stand in the site, by their path in the
    repository."""
    results = sorted((ROOT / "benchmarks" / "results").iterdir())
    found = {f"benchmarks/results/{path.name}": f"results/{path.name}" for path in results}
    return found | {"CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md"}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the files from outside of docs, and the page of the commands."""
    for source, place in taken().items():
        files.append(File.generated(config, place, abs_src_path=str(ROOT / source)))
    files.append(File.generated(config, "commands.md", content=commands.page()))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links through the repository into links through the site."""
    places = {f"docs/{file.src_uri}": file.src_uri for file in files if file.generated_by is None}
    places |= taken() | {"README.md": "index.md"}
    source = {place: path for path, place in places.items()}.get(page.file.src_uri)
    if source is None:
        return markdown
    here = PurePosixPath(page.file.src_uri).parent

    def led(link: re.Match) -> str:
        target = posixpath.normpath(posixpath.join(posixpath.dirname(source), link[2]))
        if target not in places:
            return link[0]
        return f"{link[1]}{posixpath.relpath(places[target], str(here))}{link[3] or ''}{link[4]}"

    return LINK.sub(led, markdown)
