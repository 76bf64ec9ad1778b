"""The viewer: plays the lift in real time, and begins another one when a control has been moved."""

from __future__ import annotations

import socket
import time
from collections.abc import Sequence
from threading import Event
from typing import Final

import viser

from aframe_env.validation import InvalidValue
from train.demo.controls import Controls
from train.demo.episode import RUN_IN, Setting, begin
from train.demo.policies import choices
from train.demo.stage import CAMERAS, Stage, aim
from train.shared.cli import program

FRAMES_PER_SECOND: Final = 30.0
_FIGURES_PER_SECOND: Final = 5.0
_SETTLED: Final = 0.15
"""Time that the controls have to be left alone before another lift begins, s."""


def require_free_port(host: str, port: int) -> None:
    """Raise ``InvalidValue`` where another program has the port, or the address is not this machine's."""
    for candidate, taken in ((port, False), (0, True)):
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((host, candidate))
            except OSError as error:
                if candidate == 0:
                    raise InvalidValue(f"host = {host!r}: cannot be listened on: {error.strerror}") from None
                continue
            if not taken:
                return
            free = probe.getsockname()[1]
    raise InvalidValue(
        f"port = {port}: is in use or not allowed; choose another: {program('train.demo')} --port {free}"
    )


class Viewer:
    """Server, scene, controls and the lift that is being played."""

    def __init__(self, host: str, port: int, policies: Sequence[str]) -> None:
        """Open the server. Raises ``InvalidValue`` where a policy is not known or the port is in use."""
        offered = choices(policies)
        require_free_port(host, port)
        self._server = viser.ViserServer(host=host, port=port, label="AFrameHeave", verbose=False)
        self.address = f"http://{host}:{self._server.get_port()}"
        self.frames = 0
        """Frames drawn so far."""
        self._ended = Event()
        self._server.gui.configure_theme(
            control_width="medium", show_logo=False, show_share_button=False, brand_color=(26, 104, 140)
        )
        self._stage = Stage(self._server)
        self._controls = Controls(self._server, offered, tuple(CAMERAS)[:3])
        self._controls.on_view(self._stage.view)
        aim(self._server.initial_camera, CAMERAS["Overview"], 1.2)
        self._server.on_client_connect(self._stage.view)
        self._time = 0.0
        self._setting = self._controls.setting()
        self._begin(self._setting)

    def play(self) -> None:
        """Play until ``end`` is called from another thread, or Ctrl-C; then close the server."""
        try:
            self._play()
        finally:
            self._server.stop()

    def _play(self) -> None:
        wanted, changed = self._setting, 0.0
        last = shown = drawn = time.perf_counter()
        while not self._ended.is_set():
            now = time.perf_counter()
            setting = self._controls.setting()
            if setting != wanted:
                wanted, changed = setting, now
            if wanted != self._setting and now - changed >= _SETTLED:
                self._begin(wanted)
                last = time.perf_counter()
            if self._controls.restarted:
                self._controls.restarted = False
                self._begin(self._setting, 0.0)
            if self._controls.playing:
                self._time = min(self._time + now - last, self._episode.time + 1.0)
                self._episode.advance_to(self._time)
            last = now
            self._stage.show(self._episode.at(self._time))
            self.frames += 1
            if now - shown >= 1.0 / _FIGURES_PER_SECOND:
                self._controls.show(self._episode, self._time)
                shown = now
            if self._episode.over:
                self._controls.next_sea()
            drawn = max(drawn + 1.0 / FRAMES_PER_SECOND, time.perf_counter() - 0.1)
            self._ended.wait(max(drawn - time.perf_counter(), 0.0))

    def end(self) -> None:
        """Let ``play`` come to its end."""
        self._ended.set()

    def _begin(self, setting: Setting, at: float = RUN_IN) -> None:
        """Begin a lift, and pass over its first seconds."""
        self._setting = setting
        self._episode = begin(setting)
        self._episode.advance_to(at)
        self._time = self._episode.time
        self._stage.begin(self._episode.scenario.crane)
        self._stage.show(self._episode.at(self._time))
        self._controls.show(self._episode, self._time)
