"""Write an episode as a video: ``python -m train.video --policy ppo --out episode.mp4`` (extra ``video``).

The load under the policy is seen beside the same load with the drum still. A policy is a name, the folder of an agent
or a drive map, or module:function, as for ``train.evaluate``. The suffix of ``--out`` says what is written: .mp4, or
.gif, which every page and chat shows, but which is larger.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from datetime import datetime
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from gymnasium.error import DependencyNotInstalled
from rich.console import Console
from rich.progress import track

from aframe_env.rendering import open_painter, palette
from aframe_env.validation import InvalidValue, require_integer, require_number
from train.evaluate.one_episode import EpisodeOptions, begin
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.episode import Episode
from train.shared.run_folder import new_file, user_errors, write_atomically

Frame = npt.NDArray[np.uint8]
"""(height, width, 3)."""

_CRF: Final = 20
"""Constant rate factor of x264: lower is better and larger; above some 23 small letters blur."""
_COLOURS: Final = 255
"""Colours of a GIF: of the 256 that there may be, one says that a pixel stays as it was."""


@dataclass(frozen=True, kw_only=True)
class Options(EpisodeOptions):
    """The episode, the part of it that is shown, and the file."""

    out: Path | None = None
    """Video to write, .mp4 or .gif; by default runs/episode-DATE-TIME.mp4."""
    fps: float | None = None
    """Frames per second; by default 30 in an MP4 and 10 in a GIF, whose frames last whole hundredths of a second."""
    width: int = 960
    """Width of the picture, pixels; its height is two thirds of it."""
    beside_still: bool = True
    """Draw the load with the drum still too."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.fps is not None:
            require_number("fps", self.fps, "1/s", low=1.0, high=60.0)
        require_integer("width", self.width, low=240, high=1920)
        if self.out is not None and self.out.suffix.lower() not in WRITERS:
            raise InvalidValue(
                f"out = {str(self.out)!r}: must end in {' or '.join(WRITERS)}, as in --out {self.out.stem}.mp4"
            )

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture, pixels: both even, since an MP4 halves them for its colours."""
        return 2 * round(self.width / 2), 2 * round(self.width / 3)


def frames(episode: Episode, times: Iterable[float], options: Options) -> Iterator[Frame]:
    """Yield a picture at each of these times, which increase."""
    legend = (f"Depth error, {episode.policy.name}", "drum still" if options.beside_still else "heave of the pulley")
    painter = open_painter(options.size, legend)
    for time in times:
        episode.advance_to(time)
        moment = episode.at(time)
        history = episode.history() if options.beside_still else episode.own_history()
        scene, still = moment.driven, moment.still if options.beside_still else None
        present = [scene.time, scene.depth_error, scene.pulley_heave if still is None else still.depth_error]
        until_now = np.vstack([history[history[:, 0] < scene.time - 1e-9], present])
        yield painter.pixels(scene, until_now, still)


def write_mp4(path: Path, pictures: Iterator[Frame], size: tuple[int, int], fps: float) -> None:
    """Encode pictures as H.264, which every browser plays."""
    import imageio_ffmpeg

    try:
        imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError:
        raise DependencyNotInstalled("an MP4 needs the program ffmpeg: install it, or --out episode.gif") from None
    quality = ["-crf", str(_CRF), "-movflags", "+faststart"]
    writer = imageio_ffmpeg.write_frames(
        path, size, fps=fps, codec="libx264", quality=None, macro_block_size=2, output_params=quality
    )
    sent = 0
    with closing(writer):
        writer.send(None)
        for picture in pictures:
            try:
                writer.send(picture)
            except OSError as error:
                raise OSError(f"ffmpeg stopped after {sent} frames: is the disk full?") from error
            sent += 1
    # That ffmpeg stopped at its end is told by what it wrote alone.
    try:
        written, _ = imageio_ffmpeg.count_frames_and_secs(path)
    except RuntimeError:
        written = 0
    if written != sent:
        raise OSError(f"ffmpeg wrote {written} of {sent} frames: is the disk full?")


def write_gif(path: Path, pictures: Iterator[Frame], size: tuple[int, int], fps: float) -> None:
    """Encode pictures as a GIF that begins again at its end."""
    from PIL import Image

    first = Image.fromarray(next(pictures))
    # The renderer's own colours, though they may be few pixels, and between them those of the first picture.
    own = list(dict.fromkeys(getattr(palette, name) for name in dir(palette) if name.isupper()))
    shades = first.quantize(_COLOURS - len(own), dither=Image.Dither.NONE).getpalette() or []
    colours = Image.new("P", (1, 1))
    colours.putpalette([*np.ravel(own).tolist(), *shades])

    def reduced(picture: Image.Image) -> Image.Image:
        return picture.quantize(palette=colours, dither=Image.Dither.NONE)

    rest = (reduced(Image.fromarray(picture)) for picture in pictures)
    reduced(first).save(
        path, format="GIF", save_all=True, append_images=rest, duration=1000.0 / fps, loop=0, optimize=True
    )


@dataclass(frozen=True)
class Writer:
    """How a kind of video is written."""

    write: Callable[[Path, Iterator[Frame], tuple[int, int], float], None]
    package: str
    fps: float
    """Frames per second, where none are asked for."""
    rate: Callable[[float], float]
    """Frames per second that there can be, nearest to those asked for."""


def _whole_hundredths(fps: float) -> float:
    # Browsers slow down a GIF whose frames last one hundredth of a second.
    return 100.0 / max(2, round(100.0 / fps))


WRITERS: Final[Mapping[str, Writer]] = {
    ".mp4": Writer(write_mp4, "imageio_ffmpeg", 30.0, lambda fps: fps),
    ".gif": Writer(write_gif, "PIL", 10.0, _whole_hundredths),
}
"""By the file's suffix."""


def run(options: Options, console: Console) -> int:
    """Run the episode, and write the video."""
    out = new_file(
        options.out or Path("runs") / f"episode-{datetime.now():%Y%m%d-%H%M%S}.mp4", overwrite=options.overwrite
    )
    writer = WRITERS[out.suffix.lower()]
    for package in ("pygame", writer.package):
        if find_spec(package) is None:
            raise DependencyNotInstalled(f'{package} is not installed: pip install "aframe-heave[video]"')
    episode = begin(options)
    fps = writer.rate(options.fps or writer.fps)

    def write(path: Path) -> None:
        shown = track(options.times(fps), description=f"{episode.policy.name}:", console=console)
        writer.write(path, frames(episode, shown, options), options.size, fps)

    write_atomically(out, write)
    console.print(f"video: {out} ({out.stat().st_size / 1e6:.1f} MB)")
    return 0


def main() -> int:
    """Run the command."""
    with user_errors():
        return run(parse(Options, "train.video", __doc__ or ""), PlainConsole())


if __name__ == "__main__":
    sys.exit(main())
