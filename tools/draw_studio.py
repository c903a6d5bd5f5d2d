"""Take the pictures of the studio in docs from the page itself, with the delivery robot on it.

    make docs-studio
    python -m tools.draw_studio arena      only these pictures

This needs Chromium, and the package playwright of the extra test. Run it after you have changed the page.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from tools.browser import CHROMIUM, WINDOW, StudioProcess, browsers

if TYPE_CHECKING:
    from playwright.sync_api import Page

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "pictures" / "studio"
ROBOT = ("examples.fetch_delivery.mission:build", "--arg", "robots=2", "--inside", "robot_0")
PATIENCE_S = 120.0  # the robot works meanwhile


def _settle(page: Page) -> None:
    page.wait_for_timeout(1500)


def _look_away(page: Page) -> None:
    """Move the mouse to where it marks nothing."""
    page.mouse.move(700, WINDOW["height"] - 8)


def _arena(page: Page) -> None:
    """The views of the arena and of the cameras next to the mission."""
    page.locator("#stage .caption", has_text="position").wait_for()
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


def _tour(page: Page) -> None:
    """The small graph that runs, and the first step of the tour."""
    page.get_by_role("button", name="Take the tour").click()
    page.get_by_role("dialog").wait_for()
    page.locator("#stage .caption", has_text="the ball was seen at").wait_for()
    _look_away(page)


PICTURES: dict[str, Callable[[Page], None]] = {
    "arena": _arena,
    "mission": _mission,
    "inside": _inside,
    "palette": _palette,
    "wire": _wire,
}
STARTS: dict[str, Callable[[Page], None]] = {"tour": _tour}


def main() -> None:
    """Start the studio on the robot, and on nothing, and take each picture in light and dark."""
    if not CHROMIUM:
        sys.exit("this needs Chromium on the path")
    FOLDER.mkdir(parents=True, exist_ok=True)
    wanted = sys.argv[1:] or [*PICTURES, *STARTS]
    for arguments, pictures in (((*ROBOT, "--run"), PICTURES), ((), STARTS)):
        if pictures.keys() & wanted:
            _take(arguments, pictures, wanted)


def _take(arguments: tuple[str, ...], pictures: dict[str, Callable[[Page], None]], wanted: list[str]) -> None:
    """Start the studio, do what comes before each picture that is wanted, and take it in both themes."""
    last = [name for name in pictures if name in wanted][-1]
    with StudioProcess(*arguments) as studio, browsers() as browser:
        page = browser.new_page(viewport=WINDOW, color_scheme="light")
        page.set_default_timeout(1000 * PATIENCE_S)
        page.goto(studio.address)
        for name, act in pictures.items():
            act(page)
            if name not in wanted:
                continue
            for theme in ("light", "dark"):
                page.evaluate(f"document.querySelector('[aria-label=\"Show the {theme} theme\"]')?.click()")
                _settle(page)
                page.screenshot(path=FOLDER / f"{name}-{theme}.png")
            if name == last:
                return


if __name__ == "__main__":
    main()
