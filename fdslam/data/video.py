"""Videos as images: one frame every so many seconds, written to a folder without loss."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2

from fdslam.data.live import file_frame
from fdslam.errors import InputError
from fdslam.types import Frame

SUFFIXES = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg")


def video_frames(path: Path, every: float, folder: Path) -> Iterator[Frame]:
    """Yield frames of a video, named ``NAME@SECONDS``.

    Args:
        path: of the video.
        every: seconds between two frames; 0 takes all.
        folder: that the frames are written to, as PNG.

    Raises:
        InputError: no video that can be read, no frame in it, or a full disk.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such video")
    capture = cv2.VideoCapture(str(path.absolute()))  # else FFmpeg takes what stands before a colon for a protocol
    try:
        due, count = 0.0, 0
        while capture.isOpened() and capture.grab():
            seconds = max(capture.get(cv2.CAP_PROP_POS_MSEC) / 1000, 0.0)
            if seconds < due and count:
                continue
            ok, image = capture.retrieve()
            if not ok:
                break
            due = seconds + every
            name = f"{path}@{seconds:.2f}s"
            file = folder / f"{path.stem}_{count:06d}.png"
            if not cv2.imwrite(str(file), image, [cv2.IMWRITE_PNG_COMPRESSION, 1]):
                raise InputError(f"{file}: cannot be written; free some space in {folder}")
            count += 1
            yield file_frame(file, name)
        if not count:
            raise InputError(f"{path}: cannot be read as a video; convert it to H.264 in MP4")
    finally:
        capture.release()
