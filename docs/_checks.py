"""What the build of the site refuses: formulas that come out wrong, and links that lead nowhere."""

import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


def check_formula(text: str) -> None:
    """Raises if a fraction has no braces: docutils shows `\\frac43 x` as 43 over x."""
    if found := re.search(r"\\[dt]?frac(?![a-z{])\S*", text):
        raise ValueError(f"write `{found[0]}` with braces, \\frac{{4}}{{3}}")


class _Page(HTMLParser):
    """The anchors and the links of a page."""

    def __init__(self, path: Path):
        super().__init__()
        self.anchors, self.links = set(), []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        for name, value in attrs:
            if name == "id":
                self.anchors.add(value)
            elif name in ("href", "src"):
                self.links.append(value or "")


def dead_links(site: Path) -> list[str]:
    """Returns "page: link" of all links within a site to a file or an anchor that it lacks."""
    # `_static` has templates of the theme.
    paths = [path for path in site.rglob("*.html") if "_static" not in path.parts]
    pages = {path.resolve(): _Page(path) for path in paths}
    dead = []
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            anchors = pages[target].anchors if target in pages else ()
            if not target.exists() or (parts.fragment and unquote(parts.fragment) not in anchors):
                dead.append(f"{path.relative_to(site.resolve())}: {link}")
    return dead
