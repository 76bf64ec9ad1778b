"""Watch a lift in the browser, live, and change sea, load and policy while it runs (extra ``demo``).

``python -m train.demo``; ``--policies ppo mine:law`` offers those in place of the usual ones.
"""

from __future__ import annotations

import sys
import webbrowser
from dataclasses import dataclass
from importlib.util import find_spec

from gymnasium.error import DependencyNotInstalled
from rich.console import Console

from aframe_env.validation import require_integer
from train.shared.cli import parse
from train.shared.run_folder import user_errors


@dataclass(frozen=True)
class Options:
    """Where the page is served, and the policies that it offers."""

    policies: tuple[str, ...] = ()
    """Names, folders or module:function, as for train.evaluate; by default the laws and the shipped agents."""
    port: int = 8080
    """Port of the page."""
    host: str = "127.0.0.1"
    """Address that the page is served on; 0.0.0.0 shows it to the whole network."""
    open: bool = True
    """Open the page in the browser."""

    def __post_init__(self) -> None:
        require_integer("port", self.port, low=1, high=65535)


def run(options: Options, console: Console) -> int:
    """Serve the page until Ctrl-C."""
    if find_spec("viser") is None:
        raise DependencyNotInstalled('viser is not installed: pip install "aframe-heave[demo]"')
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
        return run(parse(Options, "train.demo", __doc__ or ""), Console())


if __name__ == "__main__":
    sys.exit(main())
