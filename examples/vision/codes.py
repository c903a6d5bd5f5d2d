"""Bar codes and QR codes are drawn, photographed askew, and read again.

    articles ─┬─ bar code ──────┐
              └─ link ─ QR code ┴─ label ─ camera ─┬─ read ─┬─ check ─ count ─ tell
                                                   └─────── draw ─ write

Shown: a graph that has its own oracle. Each label carries a bar code (EAN-13, drawn by the few lines below) and a QR
code (by OpenCV's encoder) of the same article; the camera turns it by some degrees more each time, with noise, and the
reader has to find what was written. `python examples/vision/codes.py` says what was read at which angle and writes
out/codes.png, the newest label. The graph file codes.hfg.yaml is the same graph; `hfg convert` has made it of this one.
"""

from __future__ import annotations

from typing import Annotated, Final, NamedTuple

import cv2
import numpy as np
from annotated_types import Ge, Interval, Predicate

import hfg
from hfg.images import Color, Gray
from hfg.nodes import display, files, values, vision

LEFT: Final = "0001101 0011001 0010011 0111101 0100011 0110001 0101111 0111011 0110111 0001011".split()  # noqa: SIM905
PARITIES: Final = "LLLLLL LLGLGG LLGGLG LLGGGL LGLLGG LGGLLG LGGGLL LGLGLG LGLGGL LGGLGL".split()  # noqa: SIM905


def check_digit(twelve: str) -> str:
    """Return the thirteenth digit: with it, the sum of all, those at even places three times, is a multiple of ten."""
    return str(-sum(int(digit) * (1, 3)[place % 2] for place, digit in enumerate(twelve)) % 10)


def is_article(digits: str) -> bool:
    """Say whether this is the number of an article: 13 digits, the last of which fits."""
    return len(digits) == 13 and digits.isdecimal() and check_digit(digits[:12]) == digits[12]


@hfg.node
def bar_code(digits: Annotated[str, Predicate(is_article)], *, bar: Annotated[int, Interval(ge=1, le=16)] = 3) -> Gray:
    """Draw a bar code of the kind EAN-13, with the white rim that it needs.

    Args:
      digits: the number of an article: 13 digits.
      bar: how wide the narrowest bar is, in pixels.

    Raises:
      ValueError: that is not an article number.
    """
    if not is_article(digits):
        raise ValueError(f'an article has 13 digits, the last of which checks the others, got "{digits}"')
    parity = PARITIES[int(digits[0])]  # the first digit is in how the next six are written
    right = ["".join("10"[int(bit)] for bit in code) for code in LEFT]
    drawn = {"L": LEFT, "G": [code[::-1] for code in right]}
    first = "".join(drawn[kind][int(digit)] for kind, digit in zip(parity, digits[1:7], strict=True))
    bits = f"101{first}01010{''.join(right[int(digit)] for digit in digits[7:])}101"
    row = np.array([0 if bit == "1" else 255 for bit in "0" * 11 + bits + "0" * 11], np.uint8)
    return np.tile(np.repeat(row, bar), (40 * bar, 1))


@hfg.node
def label(bars: Gray, dots: Gray) -> Gray:
    """Print both codes on a label, side by side."""
    height = max(bars.shape[0], dots.shape[0])
    parts = [
        cv2.copyMakeBorder(one, (height - one.shape[0]) // 2 + 20, (height - one.shape[0] + 1) // 2 + 20, 10, 10,
                           cv2.BORDER_CONSTANT, value=255)
        for one in (bars, dots)
    ]  # fmt: skip
    return np.hstack(parts)


class Shot(NamedTuple):
    """What the camera gives: a picture, and by how many degrees the label is turned in it."""

    image: Color
    angle: float


class Camera(hfg.Node):
    """Photograph labels that lie on a table, each turned by some degrees more than the one before.

    Attributes:
      label: what lies there.
      step: degrees from one picture to the next.
      noise: of each pixel, the standard deviation.
      image: the picture, the label in its middle.
      angle: by how many degrees the label is turned, against the clock.
    """

    label = hfg.Input(Gray)
    image = hfg.Output(Color)
    angle = hfg.Output(float)
    step = hfg.Parameter(5.0, unit="deg")
    noise = hfg.Parameter(6.0, Ge(0))
    number = hfg.State(0)

    def process(self, label: Gray) -> Shot:
        """Take a picture."""
        angle = self.number * self.step
        height, width = label.shape
        side = round(float(np.hypot(height, width))) + 20
        turn = cv2.getRotationMatrix2D((width / 2, height / 2), angle, 1)
        turn[:, 2] += (side - width) / 2, (side - height) / 2
        table = np.full((side, side), 110, np.uint8)
        seen = cv2.warpAffine(label, turn, (side, side), table, borderMode=cv2.BORDER_TRANSPARENT)
        grain = np.random.default_rng(self.number).normal(0, self.noise, seen.shape)
        self.number += 1
        grainy = np.clip(cv2.GaussianBlur(seen, (3, 3), 0) + grain, 0, 255).astype(np.uint8)
        return Shot(cv2.cvtColor(grainy, cv2.COLOR_GRAY2BGR), angle)


@hfg.node
def check(texts: list[str], article: str, link: str, angle: float) -> str:
    """Say which of the two codes were read, and whether anything was read that is not there."""
    found = [name for name, text in (("bar code", article), ("QR code", link)) if text in texts]
    wrong = sorted(set(texts) - {article, link})
    return f"{angle:3.0f} degrees: {' and '.join(found) or 'nothing'}{f', WRONG: {wrong}' if wrong else ''}"


def articles(count: int) -> list[str]:
    """Make numbers of articles."""
    twelve = [f"{400638100000 + 7919 * number}" for number in range(count)]
    return [digits + check_digit(digits) for digits in twelve]


def build(image: str = "out/codes.png", count: int = 19) -> hfg.Graph:
    """Build the graph.

    Args:
      image: the file that shows the newest label.
      count: how many labels are read.
    """
    graph = hfg.Graph("codes")
    graph.group("reader", threads=1)
    graph.group("camera", threads=1)
    numbers = graph.add(values.ListSource(values=articles(count)), name="articles")
    link = graph.add(values.format_text(format="https://example.org/article/{}"), name="link")
    bars, dots = graph.add(bar_code()), graph.add(vision.qr_code(scale=6), group="camera")
    printed, camera = graph.add(label()), graph.add(Camera(), group="camera")
    read, checked = graph.add(vision.BarcodeReader(), name="read", group="reader"), graph.add(check())
    tell = graph.add(display.TextDisplay(format="{}"), name="tell")
    draw = graph.add(vision.draw_boxes(), name="draw")
    write = graph.add(files.WriteImage(path=image), name="write", group="camera")

    graph.connect(numbers.out, bars.digits)
    graph.connect(numbers.out, link.values[0])
    link >> dots
    graph.connect(bars.out, printed.bars)
    graph.connect(dots.out, printed.dots)
    printed >> camera
    graph.connect(camera.image, read.image)
    graph.connect(read.texts, checked.texts)
    graph.connect(numbers.out, checked.article)
    graph.connect(link.out, checked.link)
    graph.connect(camera.angle, checked.angle)
    graph.connect(checked.out, tell.value)
    graph.connect(camera.image, draw.image)
    graph.connect(read.boxes, draw.boxes)
    graph.connect(read.texts, draw.labels)
    draw >> write
    return graph


if __name__ == "__main__":
    hfg.run(build())
