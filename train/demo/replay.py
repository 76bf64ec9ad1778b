"""A replay of an episode as one file, for a page that nothing serves."""

from __future__ import annotations

import socket
from collections.abc import Iterable
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Final

import viser

from train.demo.controls import metres
from train.demo.stage import CAMERAS, Stage, aim
from train.shared.episode import Episode
from train.shared.run_folder import write_atomically

FRAMES_PER_SECOND: Final = 15.0
_FRAMES_OF_A_CAPTION: Final = 5
"""Faster, nobody reads figures."""


def replay(episode: Episode, times: Iterable[float], fps: float) -> viser.infra.StateSerializer:
    """Record the scene at these times, which increase, so many a second."""
    # A scene lives on a server. Nobody is to visit this one: it does not say where it is.
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    with redirect_stdout(StringIO()):
        server = viser.ViserServer(host="127.0.0.1", port=port, verbose=False)
    try:
        stage = Stage(server)
        stage.begin(episode.scenario.crane)
        aim(server.initial_camera, CAMERAS["Overview"], 1.2)
        caption = server.scene.add_label(
            "/caption", "", position=(-17.0, 0.0, 23.0), anchor="bottom-center", font_screen_scale=1.1
        )
        recording = server.get_scene_serializer()
        for frame, time in enumerate(times):
            episode.advance_to(time)
            moment = episode.at(time)
            stage.show(moment)
            if frame % _FRAMES_OF_A_CAPTION == 0:
                caption.text = (
                    f"{episode.policy.name}, {time:.1f} s\n"
                    f"depth error {metres(moment.driven.depth_error)}, drum still {metres(moment.still.depth_error)}"
                )
            recording.insert_sleep(1.0 / fps)
        return recording
    finally:
        with redirect_stdout(StringIO()):
            server.stop()


def write_replay(path: Path, episode: Episode, times: Iterable[float], fps: float) -> None:
    """Write a replay, all or nothing: a page that has all in it, or as .viser the recording alone, for viser's page."""
    recording = replay(episode, times, fps)
    data = recording.as_html().encode() if path.suffix.lower() == ".html" else recording.serialize()
    write_atomically(path, lambda temporary: temporary.write_bytes(data))
