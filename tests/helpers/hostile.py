"""Values of files that try to become markup, and whether a page is still only what its template says."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path

MARK = "taken"
OURS = ("data:image/", "#", "replays/", "recording%3D", "../_report.html")  # addresses in our pages
SCRIPT = f"</script><script id={MARK}>document.title='{MARK}'</script>"
HOSTILE = f"""{SCRIPT}<img id={MARK} src=x onerror=alert(1)>"'&<b id={MARK}>"""
# A file's name holds no slash, so it cannot end an element.
HOSTILE_NAME = f"""<img id={MARK} src=x onerror=alert(1)>"'&amp; <b id={MARK}>"""


class Elements(HTMLParser):
    """Collect the elements of a page that no template has."""

    def __init__(self) -> None:
        super().__init__()
        self.foreign: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note an element with the mark, a handler of events, or an address elsewhere."""
        for name, value in attrs:
            address = name in ("src", "href") and not (value or "").startswith(OURS)
            if name.startswith("on") or address or (name == "id" and MARK in (value or "")):
                self.foreign.append(f"{tag} {name}={value}")


def foreign_elements(page: Path) -> list[str]:
    """Return elements of a page on disk that a value has made."""
    parser = Elements()
    parser.feed(page.read_text(encoding="utf-8"))
    return parser.foreign
