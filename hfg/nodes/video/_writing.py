"""A sink that writes a video file."""

from __future__ import annotations

import errno
import os
import stat
import sys
from pathlib import Path
from typing import Any, Final, Literal

import cv2
from annotated_types import Interval

from hfg.base.places import Place
from hfg.images import Picture
from hfg.nodes._encodable import need_encodable
from hfg.nodes._pictures import colour, need_picture
from hfg.nodes.files.access import reaching
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Parameter, State, slot

_LEAST_BYTES: Final = 64 * 1024
"""More than OpenCV holds back, so that what it could not write would not fit now either."""

_NARROWEST: Final = 8
"""OpenCV writes beyond its memory when it packs narrower pictures as MJPG."""


class WriteVideo(Node):
    """Write pictures into a video file.

    The file is complete or absent: pictures go into a temporary file next to it, which is renamed when the stream ends,
    the run is over or `finish` is called. An existing file stays until then. Without a picture nothing is written.
    After `finish` the next picture begins another video, which takes the place of the first unless `path` was changed.

    Attributes:
      path: the file; missing directories are created.
      codec: how pictures are packed: "MJPG" and "XVID" for .avi, "mp4v" for .mp4.
      fps: pictures per second that players show.
      width: in pixels; pictures are scaled to it. 0 takes that of the first picture.
      height: in pixels; pictures are scaled to it. 0 takes that of the first picture.
      image: the picture, gray or blue, green, red; all of one size unless width and height are given.
      finish: close the video and give it its name.
      clear: throw away what was written since the last video.
      written: the path of a video that is complete.

    Raises:
      FileNotFoundError: no video is named.
      OSError: the file cannot be written; the message says why.
      ValueError: a picture has another size than the first or is too narrow, or OpenCV does not write such a file.

    CS::APEX: csapex::MakeVideo.
    """

    path = Parameter("", save=True)
    codec = Parameter("MJPG", type=Literal["MJPG", "XVID", "mp4v", "FFV1"])
    fps = Parameter(25.0, Interval(gt=0, le=1000), unit="1/s")
    width = Parameter(0, Interval(ge=0, le=16384), unit="px")
    height = Parameter(0, Interval(ge=0, le=16384), unit="px")
    image = Input(Picture)
    written = Event(str)

    writer: State[Any] = State(None)
    unfinished: State[_Unfinished | None] = State(None)
    target = State("")
    size = State((0, 0))
    count = State(0)

    def setup(self) -> None:
        """See that a file can be written there before the first picture comes."""
        if not self.path:
            raise FileNotFoundError('no video is named: set path, as in WriteVideo(path="people.avi")')
        need_encodable("the path", self.path)
        self._folder()

    def _folder(self) -> Path:
        folder = Path(self.path).absolute().parent
        with reaching(self.path, "write"):
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except FileExistsError:  # as a file
                raise NotADirectoryError(errno.ENOTDIR, "") from None
        return folder

    def process(self, image: Picture) -> None:
        """Append the picture."""
        need_picture(self, image)
        shape = (self.width or image.shape[1], self.height or image.shape[0])
        if self.writer is None:
            self._begin(shape)
        if shape != self.size:
            raise ValueError(
                f'the video "{self.target}" has pictures of {self.size[0]} x {self.size[1]} pixels, got one of '
                f"{shape[0]} x {shape[1]}: scale it, or set width and height"
            )
        self._need_room()
        if (image.shape[1], image.shape[0]) != self.size:
            self.writer.write(cv2.resize(colour(image), self.size))
        else:
            self.writer.write(colour(image))
        self.count += 1

    def _need_room(self) -> None:
        """OpenCV does not say that a disk is full, so look before each picture."""
        assert self.unfinished is not None
        if _room(self.unfinished.path) < _LEAST_BYTES:
            self.clear()
            with reaching(self.target, "write"):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def _begin(self, size: tuple[int, int]) -> None:
        if self.codec == "MJPG" and size[0] < _NARROWEST:
            raise ValueError(
                f"MJPG needs pictures that are at least {_NARROWEST} pixels wide, got {size[0]} x {size[1]}: "
                'set width and height, or take "mp4v" and a name that ends with .mp4'
            )
        target = Path(self.path).absolute()
        self._folder()
        with reaching(self.path, "write"):
            unfinished = _Unfinished(target)
        writer = cv2.VideoWriter(str(unfinished.path), cv2.VideoWriter.fourcc(*self.codec), self.fps, size)
        if not writer.isOpened():
            with reaching(self.path, "write"):
                try:
                    _need_room(unfinished.path)
                finally:
                    unfinished.remove()
            raise ValueError(
                f'OpenCV does not write "{self.path}" with the codec {self.codec}: take "MJPG" and a name that ends '
                "with .avi"
            )
        self.writer, self.unfinished, self.target, self.size = writer, unfinished, str(target), size
        self.count = 0

    @slot
    def finish(self) -> None:
        """Close the video and give it its name."""
        self._complete()

    @slot
    def clear(self) -> None:
        """Throw away what was written since the last video."""
        if self.unfinished is not None:
            self.writer.release()
            self.unfinished.remove()
            self.writer = self.unfinished = None

    def _close(self) -> str:
        unfinished = self.unfinished
        assert unfinished is not None
        self.writer.release()
        self.writer = self.unfinished = None
        try:
            with reaching(self.target, "write"):
                _need_complete(unfinished.path, self.count)
                unfinished.take_over()
        finally:
            unfinished.remove()
        return self.target

    def end(self) -> None:
        """The stream is over, so the video is complete."""
        self._complete()

    def _complete(self) -> None:
        if self.writer is not None:
            self.written.trigger(self._close())

    def teardown(self) -> None:
        """Send the file its name, even if the run failed elsewhere: every picture in it is complete."""
        if self.writer is not None:
            self._close()


class _Unfinished:
    """A file next to another one, in a folder that only this user can enter.

    OpenCV writes to a path, so whoever may write to the outer folder could put a link in the place of the file. The
    path leads through the handle of the folder, so that it stays the right one if the folder is moved.

    Attributes:
      path: of the file, which OpenCV creates.
    """

    def __init__(self, target: Path) -> None:
        self._place = Place(target)
        self._folder = self._place.make_folder(f".{target.stem}-")
        self._handle = -1
        inside = self._place.path.with_name(self._folder)
        self._name = f"video{target.suffix}"
        if sys.platform == "linux":
            self._handle = self._place.open(os.O_RDONLY | os.O_DIRECTORY, self._folder)
            there = os.fstat(self._handle)
            if there.st_uid != os.geteuid() or stat.S_IMODE(there.st_mode) != stat.S_IRWXU:
                os.close(self._handle)
                raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))
            inside = Path(f"/proc/self/fd/{self._handle}")
        self.path = inside / self._name

    def take_over(self) -> None:
        """Put it in the place of the other file.

        Raises:
          OSError: it cannot be renamed.
        """
        if self._handle >= 0:
            self._place.take_over(self._name, folder=self._handle)
        else:
            self.path.replace(self._place.path)

    def remove(self) -> None:
        """Remove what is left of it."""
        self.path.unlink(missing_ok=True)
        if self._handle >= 0:
            os.close(self._handle)
            self._handle = -1
        with self._place:
            self._place.remove_folder(self._folder)


def _need_room(file: Path) -> None:
    """See that a file can become longer, and leave it as it is.

    Raises:
      OSError: the disk is full, or a limit is reached.
    """
    with file.open("ab") as stream:
        length = stream.tell()
        try:
            stream.write(bytes(_LEAST_BYTES))
            stream.flush()
            os.fsync(stream.fileno())
        finally:
            os.ftruncate(stream.fileno(), length)


def _need_complete(file: Path, count: int) -> None:
    """Check that a video has `count` pictures and its index, because OpenCV does not report what it could not write.

    Raises:
      OSError: it does not.
    """
    _need_room(file)
    video = cv2.VideoCapture(str(file))
    try:
        said = video.get(cv2.CAP_PROP_FRAME_COUNT)
        video.set(cv2.CAP_PROP_FORMAT, -1)  # packets are counted, which need not be decoded for that
        found = 0
        while video.grab():
            found += 1
    finally:
        video.release()
    if found != count or abs(said - count) > 1:
        raise OSError(errno.EIO, f"of {count} pictures {found} came to the disk; is it full?")


def _room(file: Path) -> int:
    """Return how many bytes the disk of a file has left for this user."""
    if not hasattr(os, "statvfs"):
        return _LEAST_BYTES
    disk = os.statvfs(file)
    return disk.f_frsize * (disk.f_bavail if os.geteuid() else disk.f_bfree)
