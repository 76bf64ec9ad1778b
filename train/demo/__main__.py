"""Watch a lift in the browser, live, and change sea, load and policy while it runs (extra ``demo``).

``python -m train.demo``; ``--policies ppo mine:law`` offers those in place of the usual ones.

``--record FILE.html`` serves nothing, but writes one episode as a page that plays offline; the episode is chosen as for
``train.video``, by ``--policy``, ``--scenario`` and so on.
"""

from __future__ import annotations

import sys
import webbrowser
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from gymnasium.error import DependencyNotInstalled
from rich.console import Console
from rich.progress import track

from aframe_env.validation import InvalidValue, require_integer
from train.evaluate.one_episode import EpisodeOptions, begin
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.run_folder import new_file, user_errors

RECORDINGS: Final = (".html", ".viser")
"""Suffixes of recordings."""


@dataclass(frozen=True, kw_only=True)
class Options(EpisodeOptions):
    """Where the page is served, and the policies that it offers; or the episode that is recorded."""

    policies: tuple[str, ...] = ()
    """Names, folders or module:function, as for train.evaluate; by default the laws and the shipped agents."""
    port: int = 8080
    """Port of the page."""
    host: str = "127.0.0.1"
    """Address that the page is served on; 0.0.0.0 shows it to the whole network."""
    open: bool = True
    """Open the page in the browser."""
    record: Path | None = None
    """Record an episode instead: FILE.html, a page that plays offline, or FILE.viser, the recording alone."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_integer("port", self.port, low=1, high=65535)
        if self.record is not None and self.record.suffix.lower() not in RECORDINGS:
            raise InvalidValue(
                f"record = {str(self.record)!r}: must end in {' or '.join(RECORDINGS)}, as in --record "
                f"{self.record.stem}.html"
            )


def run(options: Options, console: Console) -> int:
    """Write the recording that was asked for, or else serve the page until Ctrl-C."""
    for package in ("viser", "trimesh"):
        if find_spec(package) is None:
            raise DependencyNotInstalled(f'{package} is not installed: pip install "aframe-heave[demo]"')
    return _serve(options, console) if options.record is None else _record(options, options.record, console)


def _record(options: Options, path: Path, console: Console) -> int:
    # Imported late, as the viewer: they need the extra.
    from train.demo.replay import FRAMES_PER_SECOND, write_replay

    out = new_file(path, overwrite=options.overwrite, option="record")
    episode = begin(options)
    shown = track(options.times(FRAMES_PER_SECOND), description=f"{episode.policy.name}:", console=console)
    write_replay(out, episode, shown, FRAMES_PER_SECOND)
    console.print(f"replay: {out} ({out.stat().st_size / 1e6:.1f} MB)")
    return 0


def _serve(options: Options, console: Console) -> int:
    from train.demo.viewer import Viewer

    viewer = Viewer(options.host, options.port, options.policies)
    console.print(f"live: {viewer.address} (Ctrl-C ends it)")
    if options.open:
        webbrowser.open(viewer.address)
    try:
        viewer.play()
    except KeyboardInterrupt:
        console.print("ended")
    return 0


def main() -> int:
    """Run the command."""
    with user_errors():
        return run(parse(Options, "train.demo", __doc__ or ""), PlainConsole())


if __name__ == "__main__":
    sys.exit(main())
