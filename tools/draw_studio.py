"""Take the pictures of the studio in docs from the page itself, with the delivery robot on it.

    make docs-studio
    python -m tools.draw_studio arena      only these pictures
    python -m tools.draw_studio robot      only the picture of the README that moves

This needs Chromium, and the package playwright of the extra test. Run it after you have changed the page.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

from tools.browser import CHROMIUM, WINDOW, StudioProcess, browsers

if TYPE_CHECKING:
    from playwright.sync_api import Page

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "pictures" / "studio"
ROBOT = ("examples.fetch_delivery.mission:build", "--arg", "robots=2", "--inside", "robot_0", "--run")
FILM = FOLDER / "robot.webp"
FRAMES, EVERY_MS, SHOWN_MS = 40, 350, 160
SMALL = 1080, 675
PATIENCE_S = 120.0  # the robot works meanwhile


def _settle(page: Page) -> None:
    page.wait_for_timeout(1500)


def _look_away(page: Page) -> None:
    """Move the mouse to where it marks nothing."""
    page.mouse.move(700, WINDOW["height"] - 8)


def _arena(page: Page) -> None:
    """The views of the arena and of the cameras next to the mission."""
    page.locator("#stage .caption", has_text="position").wait_for()
    page.locator('[data-node="robot_0/fetch"].active').wait_for()
    page.locator(".live", has_text=re.compile("^live$")).wait_for()
    _look_away(page)


def _mission(page: Page) -> None:
    """The mission at work, with a node of it in the inspector."""
    page.keyboard.press("v")
    page.locator('[data-node="robot_0/fetch"].active').wait_for()
    page.locator('[data-node="robot_0/advance"] .t b').click()
    _look_away(page)


def _inside(page: Page) -> None:
    """One level deeper."""
    page.locator('[data-node="robot_0/fetch"] .t b').dblclick()
    page.locator('[data-node="robot_0/fetch/visit"]').wait_for()
    page.locator('[data-node="robot_0/fetch/visit"] .t b').dblclick()
    page.locator('[data-node="robot_0/fetch/visit/position"] .t b').click()
    _look_away(page)


def _palette(page: Page) -> None:
    """What can be added, where one clicks twice."""
    page.keyboard.press("Backspace")
    page.keyboard.press("Backspace")
    page.locator('[data-node="robot_0/fetch"]').wait_for()
    page.keyboard.press("Tab")
    page.keyboard.type("thresh")
    page.locator(".palette li.sel").wait_for()


def _wire(page: Page) -> None:
    """What a wire may lead to."""
    page.keyboard.press("Escape")
    box = page.locator('[data-port="robot_0/advance.command"]').bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 4, box["y"] + 4)
    page.mouse.down()
    page.mouse.move(box["x"] + 90, box["y"] + 50, steps=4)
    page.locator(".dragline .num").first.wait_for()


def _near(page: Page) -> None:
    """What values pass the ports of a node, close up."""
    page.keyboard.press("Escape")
    page.mouse.up()
    page.keyboard.press("Home")
    page.locator('[data-node="robot_0/fetch"] .t b').click()
    _settle(page)  # the view moves
    box = page.locator('[data-node="robot_0/fetch"]').bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    while "near" not in (page.locator("#canvas").get_attribute("class") or ""):
        page.mouse.wheel(0, -120)
        page.wait_for_timeout(100)
    page.locator(".pv .known").first.wait_for()
    _look_away(page)


def _far(page: Page) -> None:
    """Everything in the robot at once."""
    page.keyboard.press("Escape")
    page.keyboard.press("u")
    page.locator(".far-label").first.wait_for()
    page.keyboard.press("Home")
    _look_away(page)


def _tour(page: Page) -> None:
    """The small graph that runs, and the first step of the tour."""
    page.get_by_role("button", name="Take the tour").click()
    page.get_by_role("dialog").wait_for()
    page.locator("#stage .caption", has_text="the ball was seen at").wait_for()
    _look_away(page)


def _film(page: Page) -> None:
    """The robot at work, as a picture that moves, faster than it did."""
    _arena(page)
    frames = []
    for _ in range(FRAMES):
        frames.append(Image.open(BytesIO(page.screenshot())).convert("RGB").resize(SMALL, Image.Resampling.LANCZOS))
        page.wait_for_timeout(EVERY_MS)
    first, *others = frames
    first.save(FILM, save_all=True, append_images=others, duration=SHOWN_MS, loop=0, quality=75, method=2)


PICTURES: dict[str, Callable[[Page], None]] = {
    "arena": _arena,
    "mission": _mission,
    "inside": _inside,
    "palette": _palette,
    "wire": _wire,
    "near": _near,
    "far": _far,
}
STARTS: dict[str, Callable[[Page], None]] = {"tour": _tour}


def main() -> None:
    """Start the studio on the robot, and on nothing, and take each picture in light and dark."""
    if not CHROMIUM:
        sys.exit("this needs Chromium on the path")
    FOLDER.mkdir(parents=True, exist_ok=True)
    wanted = sys.argv[1:] or [*PICTURES, *STARTS, FILM.stem]
    for arguments, pictures in ((ROBOT, PICTURES), ((), STARTS)):
        if pictures.keys() & wanted:
            with _opened(*arguments) as page:
                _take(page, pictures, wanted)
    if FILM.stem in wanted:
        with _opened(*ROBOT) as page:
            _film(page)


@contextmanager
def _opened(*arguments: str) -> Iterator[Page]:
    with StudioProcess(*arguments) as studio, browsers() as browser:
        page = browser.new_page(viewport=WINDOW, color_scheme="light")
        page.set_default_timeout(1000 * PATIENCE_S)
        page.goto(studio.address)
        yield page


def _take(page: Page, pictures: dict[str, Callable[[Page], None]], wanted: list[str]) -> None:
    """Do what comes before each picture that is wanted, and take it in both themes."""
    last = [name for name in pictures if name in wanted][-1]
    for name, act in pictures.items():
        act(page)
        if name in wanted:
            for theme in ("light", "dark"):
                page.evaluate(f"document.querySelector('[aria-label=\"Show the {theme} theme\"]')?.click()")
                _settle(page)
                page.screenshot(path=FOLDER / f"{name}-{theme}.png")
        if name == last:
            return


if __name__ == "__main__":
    main()
