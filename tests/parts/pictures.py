"""A program that the tests run, and kill: pictures go to another process and come back.

    frames ─ flip ─ judge
     here    "far"   here

It prints one line of JSON for each picture: its number, whether it is right, and which shared memory it lay in, there
and here.
"""

from __future__ import annotations

import json
import logging
import os
import signal
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import hfg
from hfg.images import Color

KEPT: list[Any] = []


@dataclass
class Flipped:
    number: int
    picture: Color
    lay_in: str


@dataclass
class Frame:
    number: int
    picture: Color


def picture_of(number: int) -> Color:
    return np.random.default_rng(number).integers(0, 256, (720, 1280, 3), np.uint8)


def segment_of(array: np.ndarray[Any, Any]) -> str:
    """Give the name of the shared memory that an array lies in, as the kernel knows it; "" if it lies in none."""
    address = array.__array_interface__["data"][0]
    with Path("/proc/self/maps").open(encoding="ascii") as lines:
        for line in lines:
            first, last = (int(number, 16) for number in line.split(maxsplit=1)[0].split("-"))
            if first <= address < last:
                return line.rpartition("/dev/shm/")[2].split()[0] if "/dev/shm/" in line else ""
    return ""


def die(where: str) -> None:
    os.write(1, json.dumps({"dies": where}).encode() + b"\n")
    os.kill(os.getpid(), signal.SIGKILL)


class Frames(hfg.Node):
    """Fills pictures where they are sent from."""

    out = hfg.Output(Frame)
    count = hfg.Parameter(20)

    def process(self) -> Iterator[Frame]:
        for number in range(self.count):
            picture = self.out.loan((720, 1280, 3), np.uint8)
            picture[:] = picture_of(number)
            yield Frame(number, picture)


@hfg.node
def flip(frame: Frame, *, keeps: bool = False, dies_at: int = -1, mark: str = "") -> Flipped:
    if keeps:
        KEPT.append(frame.picture)
    if frame.number == dies_at and not Path(mark).exists():
        Path(mark).touch()
        die("flip")
    return Flipped(frame.number, frame.picture[::-1].copy(), segment_of(frame.picture))


@hfg.node
def judge(flipped: Flipped, *, dies_at: int = -1) -> None:
    right = bool((flipped.picture[::-1] == picture_of(flipped.number)).all())
    said = {"number": flipped.number, "right": right, "there": flipped.lay_in, "here": segment_of(flipped.picture)}
    os.write(1, json.dumps(said).encode() + b"\n")
    if flipped.number == dies_at:
        die("judge")


def main(count: int, keeps: bool, flip_dies_at: int, mark: str, judge_dies_at: int) -> None:
    logging.basicConfig(level=logging.INFO)
    graph = hfg.Graph("pictures")
    graph.group("far", process=True)
    source = graph.add(Frames(count=count))
    middle = graph.add(flip(keeps=keeps, dies_at=flip_dies_at, mark=mark), group="far")
    last = graph.add(judge(dies_at=judge_dies_at))
    graph.connect(source.out, middle.frame)
    graph.connect(middle.out, last.flipped)
    hfg.run(graph)


if __name__ == "__main__":
    main(*json.loads(sys.argv[1]))
