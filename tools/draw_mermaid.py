"""Draw the Mermaid diagrams of the pages as pictures for the site, one for light and one for dark pages.

    make docs-mermaid

Mermaid runs in a browser, so this needs Chromium and npm, and network access to fetch Mermaid once. The pictures are in
the repository, so that building the site needs neither. Run it after you have changed a diagram.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

from tools.build_docs import DIAGRAMS, ROOT, diagram_name, diagrams

VERSION = "11.17.2"
FOLDER = ROOT / "docs" / DIAGRAMS
THEMES = {"light": "default", "dark": "dark"}
PAGE = """<!doctype html><meta charset="utf-8"><body><script src="mermaid.min.js"></script><script>
mermaid.initialize({startOnLoad: false, theme: %s, htmlLabels: false, fontFamily: "sans-serif", deterministicIds: true,
  flowchart: {htmlLabels: false}});
mermaid.render("diagram", %s).then(
  ({svg}) => { document.body.innerHTML = svg; }, error => { document.body.textContent = "failed: " + error; });
</script></body>"""


def mermaid(folder: Path) -> None:
    """Fetch Mermaid from npm into a folder."""
    subprocess.run(["npm", "pack", "--silent", f"mermaid@{VERSION}"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    with tarfile.open(folder / f"mermaid-{VERSION}.tgz") as package:
        script = package.extractfile("package/dist/mermaid.min.js")
        assert script is not None
        (folder / "mermaid.min.js").write_bytes(script.read())


def draw(source: str, theme: str, folder: Path, browser: str) -> str:
    """Return the picture of a diagram as SVG."""
    (folder / "page.html").write_text(PAGE % (json.dumps(theme), json.dumps(source)), encoding="utf-8")
    command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=20000", "--dump-dom"]
    shown = subprocess.run(
        [*command, (folder / "page.html").as_uri()], check=True, capture_output=True, text=True, timeout=120
    )
    found = re.search(r"<svg.*</svg>", shown.stdout, re.S)
    if found is None:
        sys.exit(f"Mermaid could not draw this diagram:\n{source}\n{shown.stdout[-500:]}")
    svg = found[0].replace("<br>", "<br/>").replace('width="100%"', "", 1)
    return re.sub(r'viewBox="\S+ \S+ (\d+)\S* (\d+)[^"]*"', r'\g<0> width="\1" height="\2"', svg, count=1) + "\n"


def main() -> None:
    """Draw what is new, and remove the pictures of diagrams that no page has any more."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None or shutil.which("npm") is None:
        sys.exit("this needs Chromium and npm on the path")
    FOLDER.mkdir(parents=True, exist_ok=True)
    wanted = {
        f"{diagram_name(source)}.{name}.svg": (source, theme) for source in diagrams() for name, theme in THEMES.items()
    }
    with tempfile.TemporaryDirectory() as made:
        for file, (source, theme) in wanted.items():
            if not (FOLDER / file).exists():
                if not (Path(made) / "mermaid.min.js").exists():
                    mermaid(Path(made))
                (FOLDER / file).write_text(draw(source, theme, Path(made), browser), encoding="utf-8")
                sys.stdout.write(f"docs/{DIAGRAMS}/{file}\n")
    for drawn in FOLDER.glob("*.svg"):
        if drawn.name not in wanted:
            drawn.unlink()


if __name__ == "__main__":
    main()
