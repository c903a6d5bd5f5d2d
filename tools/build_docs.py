"""Build the documentation as a site in `build/site`. No page loads anything from another host.

    python tools/build_docs.py
    python -m http.server -d build/site     # opening build/site/index.html from disk works, too

`mkdocs.yml` has the settings and the navigation. Requires `pip install -e '.[docs]'`. The steps:

1. Copy `docs/` to `build/docs` and translate what GitHub and the site write differently: see `stage`.
2. Build the site with Zensical, which fails if a link or an anchor is broken.
3. Finish the pages: link the rules and pages that they name, and load the search's script from the site: see `finish`.
4. Check that every page is complete and loads nothing from another host: see `problems`.
"""

from __future__ import annotations

import hashlib
import html
import pkgutil
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from posixpath import join, normpath
from urllib.parse import unquote, urlsplit

import msgspec

ROOT = Path(__file__).resolve().parent.parent
STAGED, SITE = ROOT / "build" / "docs", ROOT / "build" / "site"
ASSETS = Path(__file__).parent / "site"
DIAGRAMS = "pictures/mermaid"
REPOSITORY = ""  # "https://.../blob/main/" once there is a public one

_FENCE = re.compile(r"^(?P<indent> *)```(?P<info>[^\n`]*)\n(?P<code>.*?)^(?P=indent)```$", re.M | re.S)
_LEAVING = re.compile(r"(?<!!)\[([^\]]+)\]\(((?:\.\./)+[^)#\s]+)(#[^)\s]*)?\)")
_MEMBERS = re.compile(r"^::: ([\w.]+)\.\*$", re.M)
_SHIM = "https://unpkg.com/iframe-worker/shim"
_SCRIPTS_LOAD = re.compile(r"""(?<=["'`])https?://(?!www\.w3\.org/)[^"'`]*""")


# --- 1. stage ---------------------------------------------------------------------------------------------------------


def stage() -> None:
    """Copy the pages and translate them.

    - `::: module.*` becomes one entry for each public name of the module.
    - A Mermaid diagram becomes the picture that `tools/draw_mermaid.py` has drawn of it.
    - The second word of "```python no-run" is for our tests, and is removed.
    - A link to a file outside `docs/` leads to the repository, or becomes plain text while there is none.
    """
    shutil.rmtree(STAGED, ignore_errors=True)
    shutil.copytree(ROOT / "docs", STAGED)
    shutil.copytree(ASSETS, STAGED / "assets")
    for page in sorted(STAGED.rglob("*.md")):
        folder = page.relative_to(STAGED).parent.as_posix()
        text = _MEMBERS.sub(_members, page.read_text(encoding="utf-8"))
        text = _FENCE.sub(partial(_fence, folder=folder), text)
        text = _LEAVING.sub(partial(_link, folder=folder), text)
        page.write_text(text, encoding="utf-8")


def _members(match: re.Match[str]) -> str:
    module = pkgutil.resolve_name(match[1])
    return "\n\n".join(f"::: {match[1]}.{name}{_fields(getattr(module, name))}" for name in module.__all__)


def _fields(thing: object) -> str:
    """Return the fields of a struct as a code block, unless its docstring lists them. Mkdocstrings ignores structs."""
    if not (isinstance(thing, type) and issubclass(thing, msgspec.Struct)) or "Attributes:" in (thing.__doc__ or ""):
        return ""
    hints = {
        name: hint for one in reversed(thing.__mro__) for name, hint in getattr(one, "__annotations__", {}).items()
    }
    lines = [f"    {name}: {hints[name]}," for name in thing.__struct_fields__]
    return "\n\n" + "\n".join(["```python", f"{thing.__name__}(", *lines, ")", "```"])


def _fence(match: re.Match[str], folder: str) -> str:
    kind = (match["info"].split() or [""])[0]
    if kind != "mermaid":
        return f"{match['indent']}```{kind}\n{match['code']}{match['indent']}```"
    name = diagram_name(match["code"])
    up = "../" * (0 if folder == "." else folder.count("/") + 1)
    variants = [(variant, f"{DIAGRAMS}/{name}.{variant}.svg") for variant in ("light", "dark")]
    for _, file in variants:
        if not (STAGED / file).exists():
            sys.exit(f"a Mermaid diagram has changed, and docs/{file} is missing: run `make docs-mermaid`")
    *_, heading = re.findall(r"^#+ (.+)$", match.string[: match.start()], re.M)
    return "\n".join(f"![Diagram: {heading}]({up}{file}#only-{variant})" for variant, file in variants)


def diagram_name(source: str) -> str:
    """Return the name under which the picture of a Mermaid diagram is kept."""
    return hashlib.sha256(source.encode()).hexdigest()[:12]


def diagrams() -> Iterator[str]:
    """Yield the source of every Mermaid diagram in the pages."""
    for page in sorted((ROOT / "docs").rglob("*.md")):
        for match in _FENCE.finditer(page.read_text(encoding="utf-8")):
            if match["info"].strip() == "mermaid":
                yield match["code"]


def _link(match: re.Match[str], folder: str) -> str:
    text, target, anchor = match[1], match[2], match[3] or ""
    path = normpath(join("docs", folder, target))
    if path.startswith("docs/"):
        return match[0]
    if not (ROOT / path).exists():
        sys.exit(f"docs/{folder}: a link leads to {path}, which does not exist")
    if REPOSITORY:
        return f"[{text}]({REPOSITORY}{path}{anchor})"
    return text if "`" in text else f"{text} (`{path}`)"


# --- 2. build ---------------------------------------------------------------------------------------------------------


def build() -> None:
    """Run Zensical. Exit if it is missing, or if it finds a broken link or anchor."""
    zensical = shutil.which("zensical", path=str(Path(sys.executable).parent)) or shutil.which("zensical")
    if zensical is None:
        sys.exit("Zensical is missing: run `make docs`, or install it with `pip install -e '.[docs]'`")
    shutil.rmtree(SITE, ignore_errors=True)
    if subprocess.run([zensical, "build", "--clean", "--strict"], cwd=ROOT, check=False).returncode:
        sys.exit("the site was not built: see the messages of Zensical above")


# --- 3. finish --------------------------------------------------------------------------------------------------------

_TAG = re.compile(r"<!--.*?-->|<[^>]*>", re.S)
_KEEPS_TEXT = {"a", "code", "pre", "script", "style", "title", "svg", "h1", "h2", "h3", "h4", "h5", "h6"}
_REFERENCE = re.compile(r"(?<![\w.#/%:*-])(?:([TPFAGXRL]\d{1,2})(?![\w*]|[.:]\w)|docs/([\w/-]+)\.md)")


def finish() -> None:
    """Link rules and pages that are named, and let every page load the search's script from the site itself.

    The theme's script can load tools that no page of ours uses (Mermaid, an image viewer, Python) from other hosts.
    Their addresses are made invalid, so that the check of step 4 need not know which of them matter.
    """
    semantics = (SITE / "semantics.html").read_text(encoding="utf-8")
    anchors = {found[1].upper(): found[0] for found in re.findall(r'<h3 id="(([a-z]\d+)-[^"]*)"', semantics)}
    for page in sorted(SITE.rglob("*.html")):
        up = "../" * (len(page.relative_to(SITE).parts) - 1)
        text = page.read_text(encoding="utf-8").replace(_SHIM, f"{up}assets/iframe-worker.js")
        if page.name != "cv.html":  # "L1" is a norm there
            text = link_references(text, up, anchors)
        page.write_text(text, encoding="utf-8")
    for script in (SITE / "assets" / "javascripts").rglob("*.js"):
        script.write_text(_SCRIPTS_LOAD.sub("removed:", script.read_text(encoding="utf-8")), encoding="utf-8")


def link_references(page: str, up: str, anchors: dict[str, str]) -> str:
    """Make links of rule numbers ("F5") and of pages ("docs/limits.md") in the text of an article."""

    def link(match: re.Match[str]) -> str:
        target = f"semantics.html#{anchors[match[1]]}" if match[1] in anchors else f"{match[2]}.html"
        return match[0] if match[1] and match[1] not in anchors else f'<a href="{up}{target}">{match[0]}</a>'

    start, end = page.find("<article"), page.find("</article>")
    if start < 0 or end < 0:
        return page
    article, done, inside, at = page[start:end], [], 0, 0
    for tag in _TAG.finditer(article):
        text = article[at : tag.start()]
        done += [text if inside else _REFERENCE.sub(link, text), tag[0]]
        at = tag.end()
        name = re.match(r"</?(\w+)", tag[0])
        if name and name[1] in _KEEPS_TEXT:
            inside += -1 if tag[0].startswith("</") else 1
    return page[:start] + "".join(done) + article[at:] + page[end:]


# --- 4. check ---------------------------------------------------------------------------------------------------------

_LOADS = {
    "script": "src",
    "img": "src",
    "iframe": "src",
    "source": "src",
    "video": "src",
    "audio": "src",
    "link": "href",
}
_ATTRIBUTE = re.compile(r"""\b([\w-]+)=(?:"([^"]*)"|'([^']*)'|([^\s>]+))""")
_LINKS_ONLY = {"canonical", "prev", "next"}  # <link> elements that browsers do not load
_CSS_LOADS = re.compile(r"""(?:url\(\s*|@import\s+)["']?((?:https?:)?//[^"')\s]+)""")


def _tags(page: str) -> Iterator[tuple[str, dict[str, str]]]:
    for tag in re.finditer(r"<([a-z][\w-]*)\b([^>]*)>", page):
        yield tag[1], {a[0]: html.unescape(a[1] or a[2] or a[3]) for a in _ATTRIBUTE.findall(tag[2])}


def loaded_from_outside(site: Path) -> list[str]:
    """Return everything that pages, style sheets and scripts would load from another host."""
    found = []
    for file in sorted(site.rglob("*")):
        if file.suffix in (".html", ".css", ".svg", ".js") and file.name != "search.js":  # which holds the pages' text
            text = file.read_text(encoding="utf-8")
            loads = _SCRIPTS_LOAD.findall(text) if file.suffix == ".js" else [*_CSS_LOADS.findall(text), *_loads(text)]
            found += [f"{file.relative_to(site)}: {one}" for one in loads if re.match(r"(https?:)?//", one)]
    return found


def _loads(page: str) -> Iterator[str]:
    for name, attributes in _tags(page):
        if name in _LOADS and attributes.get("rel") not in _LINKS_ONLY:
            yield attributes.get(_LOADS[name], "")


def dead_links(site: Path) -> list[str]:
    """Return links within the site that lead to no file or no anchor."""
    pages = {page: page.read_text(encoding="utf-8") for page in sorted(site.rglob("*.html"))}
    ids = {page: {a["id"] for _, a in _tags(text) if "id" in a} for page, text in pages.items()}
    dead = []
    for page, text in pages.items():
        for name, attributes in _tags(text):
            target = attributes.get("href") if name in ("a", "link") else attributes.get("src")
            if not target or urlsplit(target).scheme or page.name == "404.html":
                continue
            path, _, anchor = target.partition("#")
            file = (page.parent / unquote(path)).resolve() if path else page
            if not file.exists() or (anchor and file in ids and unquote(anchor) not in {*ids[file], "__comments"}):
                dead.append(f"{page.relative_to(site)}: {target}")
    return dead


def problems(site: Path) -> list[str]:
    """Return what is wrong with a built site, in words."""
    return [
        *(f"loads from another host: {one}" for one in loaded_from_outside(site)),
        *(f"leads nowhere: {one}" for one in dead_links(site)),
    ]


def main() -> None:
    """Build, finish and check the site."""
    stage()
    build()
    finish()
    if found := problems(SITE):
        sys.exit("\n".join(found))
    pages = sum(1 for _ in SITE.rglob("*.html"))
    size = sum(file.stat().st_size for file in SITE.rglob("*") if file.is_file())
    sys.stdout.write(f"{pages} pages, {size / 1e6:.1f} MB: open {(SITE / 'index.html').as_uri()}\n")


if __name__ == "__main__":
    main()
