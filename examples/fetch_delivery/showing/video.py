"""A video that browsers play: VP8 in WebM where OpenCV has a codec for it, else an animated WebP picture.

OpenCV's wheels bring VP8 and VP9 along, and no H.264; what they write into MP4 by default is played by no browser. VP8
is a third of the work. Without any codec, pictures are kept in memory, half as large and not too many, and written in
the end.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from examples.fetch_delivery.messages import Picture

CODEC: Final = "VP80"
_MOST_KEPT: Final = 240
_MOST_WAITING: Final = 16  # for the thread that encodes


class VideoFile:
    """Writes pictures of one size.

    Attributes:
      path: of the file; its ending says which of the two it has become.
      pictures: how many it holds, or will.
      note: a remark, empty if all is well.
    """

    def __init__(self, folder: Path, name: str, size: tuple[int, int], rate_hz: float) -> None:
        """Open it.

        Args:
          folder: where.
          name: of the file, without its ending.
          size: of the pictures: width, height.
          rate_hz: how many of them are shown in a second.

        Raises:
          OSError: nothing can be written there.
        """
        self.path = folder / f"{name}.webm"
        self.note = ""
        self.pictures = 0
        self._size, self._rate_hz = size, rate_hz
        self._kept: list[Picture] = []
        self._every = 1
        self.path.open("wb").close()  # OpenCV does not say why it cannot write
        self._encoder = ThreadPoolExecutor(1, "video")
        self._waiting: deque[Future[None]] = deque()
        with _silence():  # OpenCV warns of the very tag that WebM wants
            self._writer: Any = cv2.VideoWriter(str(self.path), cv2.VideoWriter.fourcc(*CODEC), rate_hz, size)
        if not self._writer.isOpened():
            self._writer = None
            self.path.unlink()
            self.path = folder / f"{name}.webp"
            self.note = f"OpenCV has no codec {CODEC} here, so the video is an animated picture, smaller and with gaps."

    def add(self, picture: Picture) -> None:
        """Add one picture."""
        self.pictures += 1
        if self._writer is not None:
            self._waiting.append(self._encoder.submit(self._writer.write, picture))
            if len(self._waiting) > _MOST_WAITING:
                self._waiting.popleft().result()
        elif (self.pictures - 1) % self._every == 0:
            self._kept.append(
                np.asarray(cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.uint8)
            )
            if len(self._kept) > _MOST_KEPT:
                del self._kept[1::2]
                self._every *= 2

    def close(self) -> None:
        """Finish it; a write error is reported in `note`, and there is no file then."""
        self._encoder.shutdown()
        if self._writer is not None:
            self._writer.release()
            self._writer = None
            is_whole = _pictures_in(self.path) >= self.pictures
        else:
            is_whole = not self._kept or self._write_animation()
        if not is_whole:
            self.note = f'The video "{self.path}" could not be written as a whole: look whether the disk is full.'
        if not self.pictures or not _pictures_in(self.path):
            self.path.unlink(missing_ok=True)

    def _write_animation(self) -> bool:
        animation = cv2.Animation()
        animation.frames = self._kept
        animation.durations = [round(1000 * self._every / self._rate_hz)] * len(self._kept)
        try:
            written = bool(cv2.imwriteanimation(str(self.path), animation))
        except cv2.error:
            return False
        self._kept = []
        return written


def _pictures_in(path: Path) -> int:
    """Say how many pictures a file holds, as far as it can be read."""
    if path.suffix == ".webp":
        return len(cv2.imreadanimation(str(path))[1].frames) if path.exists() else 0
    with _silence():
        video = cv2.VideoCapture(str(path))
        count = round(video.get(cv2.CAP_PROP_FRAME_COUNT)) if video.isOpened() else 0
        # What is said is what was meant to be there; whether the last one is, shows when it is looked for.
        video.set(cv2.CAP_PROP_POS_FRAMES, count - 1)
        if count > 0 and not video.grab():
            count = round(video.get(cv2.CAP_PROP_POS_FRAMES))
        video.release()
    return max(count, 0)


@contextmanager
def _silence() -> Iterator[None]:
    """Keep what C code writes to standard error to ourselves."""
    kept = os.dup(2)
    with Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
