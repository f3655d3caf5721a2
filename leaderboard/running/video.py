"""Writes frames into a video: MP4 and its like through ffmpeg, GIF without it."""

from __future__ import annotations

import contextlib
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from typing_extensions import Self

FFMPEG_SUFFIXES = (".mp4", ".mkv", ".mov")
GIF_SUFFIX = ".gif"
GIF_FPS = 10.0
# A frame takes 6 to 18 kB: so a GIF of any length stays near 10 MB, and in memory until written
GIF_WIDTH_PX, GIF_FRAMES = 480, 600  # a minute
LONG_GIF_WIDTH_PX, LONG_GIF_FRAMES = 320, 1200
_LARGE_BYTES = 5_000_000  # of a GIF: from here on it is said that there are smaller forms
_CODED = ("-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "20", "-preset", "veryfast")
_TRIAL_S = 30.0  # for a program to code one frame


class VideoError(Exception):
    """A video cannot be written; says what to do instead."""


class VideoWriter(Protocol):
    """Takes frames in order; used in a `with`, which finishes the file."""

    def add(self, frame: NDArray[np.uint8]) -> None:
        """Adds a frame (H, W, 3) RGB, of the size of the first."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...


def open_video(path: Path, fps: float, ffmpeg: str | None = None) -> VideoWriter:
    """A writer for the format that the file's name ends in.

    Args:
        path: The file; its folder is made.
        fps: Frames a second.
        ffmpeg: The program to use; None looks for it.

    Raises:
        VideoError: If the format is unknown, or it needs ffmpeg and there is none that works.
    """
    program = ffmpeg or check_video(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise VideoError(f"cannot make the folder of '{path}': {error}") from error
    return GifWriter(path, fps) if program is None else FfmpegWriter(path, fps, program)


def check_video(path: Path) -> str | None:
    """Looks whether a file's format can be written.

    Returns:
        The ffmpeg program to write it with, None if it needs none.

    Raises:
        VideoError: If the format is unknown, or it needs ffmpeg and there is none that works.
    """
    suffix = path.suffix.lower()
    if suffix not in (*FFMPEG_SUFFIXES, GIF_SUFFIX):
        known = ", ".join((*FFMPEG_SUFFIXES, GIF_SUFFIX))
        raise VideoError(f"a video's file name ends in one of {known}; got '{path}'")
    return None if suffix == GIF_SUFFIX else find_ffmpeg(path)


def find_ffmpeg(path: Path) -> str:
    """An ffmpeg program that works: that of the package imageio-ffmpeg, else the system's.

    Raises:
        VideoError: If there is none, or none that works; with what they said.
    """
    complaints = []
    for program in _programs():
        complaint = _tried(program)
        if not complaint:
            return program
        complaints.append(f"; {program} does not work: {complaint}")
    raise VideoError(
        f"there is no ffmpeg to write '{path}' with{''.join(complaints)}: pip install "
        "'driveinsight[video]', or install ffmpeg, or write a GIF: --video "
        f"{path.with_suffix(GIF_SUFFIX)}"
    )


def _programs() -> Iterator[str]:
    with contextlib.suppress(ImportError, RuntimeError):
        from imageio_ffmpeg import get_ffmpeg_exe

        yield str(get_ffmpeg_exe())
    if found := shutil.which("ffmpeg"):
        yield found


def _tried(program: str) -> str:
    """What a program complains of when it is to code one frame; nothing if it can."""
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", "64x64", "-r", "1", "-i", "-"]
    command = [program, "-loglevel", "error", *raw, *_CODED, "-f", "null", "-"]
    try:
        done = subprocess.run(
            command, input=bytes(64 * 64 * 3), capture_output=True, timeout=_TRIAL_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    return _last_line(done.stderr) if done.returncode else ""


def _last_line(said: bytes) -> str:
    lines = said.decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else "it said nothing"


class FfmpegWriter:
    """Sends frames to ffmpeg as they come; H.264, playable everywhere."""

    def __init__(self, path: Path, fps: float, program: str) -> None:
        self._path, self._fps, self._program = path, fps, program
        self._process: subprocess.Popen[bytes] | None = None
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 (closed in __exit__)

    def add(self, frame: NDArray[np.uint8]) -> None:
        """Adds a frame.

        Raises:
            VideoError: If ffmpeg gives up; with what it said last.
        """
        if self._process is None:
            self._process = self._started(frame.shape[1], frame.shape[0])
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(np.ascontiguousarray(frame).tobytes())
        except OSError as error:
            raise VideoError(self._complaint()) from error

    def _started(self, width: int, height: int) -> subprocess.Popen[bytes]:
        raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}"]
        even = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2"]  # as yuv420p wants it
        command = [self._program, "-y", "-loglevel", "error", *raw, "-r", f"{self._fps:g}"]
        command += ["-i", "-", *even, *_CODED, "-movflags", "+faststart", str(self._path)]
        return subprocess.Popen(command, stdin=subprocess.PIPE, stderr=self._said)

    def _complaint(self) -> str:
        assert self._process is not None
        self._process.wait()
        self._said.seek(0)
        return f"ffmpeg could not write '{self._path}': {_last_line(self._said.read())}"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        try:
            if self._process is not None:
                assert self._process.stdin is not None
                with contextlib.suppress(OSError):
                    self._process.stdin.close()
                if self._process.wait() != 0 and kind is None:
                    raise VideoError(self._complaint())
        finally:
            self._said.close()


class GifWriter:
    """Keeps smaller frames, at most `GIF_FPS` a second, and writes them at the end.

    How many there will be is not known before. Beyond `GIF_FRAMES` all become smaller; whenever
    there are `LONG_GIF_FRAMES`, every second one goes, and the rate halves.
    """

    def __init__(self, path: Path, fps: float) -> None:
        self._path, self._fps = path, fps
        self._every = max(1, round(fps / GIF_FPS))
        self._width_px = GIF_WIDTH_PX
        self._seen = 0
        self._frames: list[Image.Image] = []

    def add(self, frame: NDArray[np.uint8]) -> None:
        """Adds a frame, or passes over it where they come too fast for a GIF."""
        if self._seen % self._every == 0:
            self._frames.append(_smaller(Image.fromarray(frame), self._width_px))
            self._keep_small()
        self._seen += 1

    def _keep_small(self) -> None:
        if len(self._frames) > GIF_FRAMES and self._width_px != LONG_GIF_WIDTH_PX:
            self._width_px = LONG_GIF_WIDTH_PX
            self._frames = [_smaller(f.convert("RGB"), self._width_px) for f in self._frames]
        if len(self._frames) > LONG_GIF_FRAMES:
            self._frames = self._frames[::2]
            self._every *= 2

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        if self._frames:
            self._frames[0].save(
                self._path,
                save_all=True,
                append_images=self._frames[1:],
                duration=round(1000.0 * self._every / self._fps),
                loop=0,
            )


def _smaller(frame: Image.Image, width_px: int) -> Image.Image:
    """A frame of that width, with colours as a GIF has them."""
    size = (width_px, round(frame.height * width_px / frame.width))
    return frame.resize(size).quantize(128, Image.Quantize.FASTOCTREE)


def video_facts(path: Path) -> str:
    """How large a video's file is, and what would be smaller: `1.2 MB`."""
    size = path.stat().st_size
    facts = f"{size / 1e6:.1f} MB"
    if path.suffix.lower() != GIF_SUFFIX:
        return facts
    with Image.open(path) as gif:
        facts += f", {gif.width} x {gif.height} pixels"
    return f"{facts}; .mp4 is sharper and smaller" if size > _LARGE_BYTES else facts
