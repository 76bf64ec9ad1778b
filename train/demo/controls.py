"""The page's panel: what is reached, the error's curve, and what can be changed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
import viser
import viser.uplot

from aframe_env.rendering import palette
from aframe_env.rendering.palette import Colour
from aframe_env.scenario import ScenarioDistribution
from train.demo.episode import Setting, reduction
from train.demo.policies import Choice
from train.demo.solids import FloatArray
from train.shared.episode import Episode

_STILL: Final[Colour] = (112, 152, 186)


class Controls:
    """Sliders, choices, buttons and figures; every page that is open shows the same."""

    def __init__(self, server: viser.ViserServer, choices: Sequence[Choice], views: Sequence[str]) -> None:
        """Lay out the panel."""
        self._choices = {choice.name: choice for choice in choices}
        gui = server.gui
        self._figures = gui.add_html("")
        self._curve = gui.add_uplot(
            (np.zeros(2), np.zeros(2), np.zeros(2)),
            (
                viser.uplot.Series(label="time, s"),
                viser.uplot.Series(label="drum still", stroke=_css(_STILL), width=2),
                viser.uplot.Series(label="this policy", stroke=_css(palette.ERROR), width=2.5),
            ),
            title="Depth error, m",
            scales={"x": viser.uplot.Scale(time=False, auto=True), "y": viser.uplot.Scale(auto=True)},
            axes=(viser.uplot.Axis(size=30), viser.uplot.Axis(size=42)),
            legend=viser.uplot.Legend(show=False),
            height=190,
            padding=(6, 12, 0, 0),
        )
        self._policy = gui.add_dropdown("Policy", tuple(self._choices), hint="What turns the drum")
        self._sensors = gui.add_checkbox(
            "Sensors", True, hint="Noisy, delayed instruments; without the tick the policy sees the full state"
        )
        spans = ScenarioDistribution()
        self._hs = gui.add_slider("Hs, m", *_span(spans.hs), 0.1, 3.0, hint="Significant wave height")
        self._tp = gui.add_slider("Tp, s", *_span(spans.tp), 0.5, 9.0, hint="Peak period of the waves")
        self._heading = gui.add_slider(
            "Heading, °", 0, 360, 5, 150, hint="Direction that the waves travel towards: 0 following, 180 head sea"
        )
        mass, length = _span(spans.load_mass), _span(spans.rope_length)
        self._mass = gui.add_slider("Load, t", 1e-3 * mass[0], 1e-3 * mass[1], 1.0, 60.0, hint="Mass of the load")
        self._length = gui.add_slider("Rope, m", *length, 10.0, 500.0, hint="Rope below the pulley, ship at rest")
        self.seed = 1
        self.playing = True
        self.restarted = False
        self._run = gui.add_button_group("Run", ("Play", "Pause", "Restart", "New sea"))
        self._views = gui.add_button_group("Camera", views)
        self._run.on_click(lambda event: self._do(event.target.value))

    def setting(self) -> Setting:
        """Return what the controls say."""
        return Setting(
            policy=self._choices[self._policy.value].text(self._sensors.value),
            sensors=self._sensors.value,
            hs=self._hs.value,
            tp=self._tp.value,
            heading=math.radians(self._heading.value),
            load_mass=1e3 * self._mass.value,
            rope_length=self._length.value,
            seed=self.seed,
        )

    def on_view(self, act: Callable[[viser.ClientHandle, str], None]) -> None:
        """Let ``act`` turn a page's camera when a view is asked for there."""

        @self._views.on_click
        def _(event: viser.GuiEvent[viser.GuiButtonGroupHandle]) -> None:
            if event.client is not None:
                act(event.client, event.target.value)

    def next_sea(self) -> None:
        """Go on with the next realisation of the sea."""
        self.seed += 1

    def show(self, episode: Episode, time: float) -> None:
        """Show figures and curve up to a time, s."""
        history = episode.history()
        history = history[history[:, 0] <= time + 1e-9]
        self._figures.content = _figures_html(episode, history)
        self._curve.data = (history[:, 0], history[:, 2], history[:, 1])

    def _do(self, what: str) -> None:
        self.playing = what != "Pause"
        if what == "Restart":
            self.restarted = True
        if what == "New sea":
            self.next_sea()


def _span(interval: object) -> tuple[float, float]:
    """Ends of an interval that scenarios are drawn from."""
    assert isinstance(interval, tuple)
    return interval


def _css(colour: Colour) -> str:
    return f"rgb{colour}"


def metres(value: float) -> str:
    """A length in centimetres below a metre, in metres above."""
    return f"{100.0 * value:.1f} cm" if abs(value) < 1.0 else f"{value:.2f} m"


def _figures_html(episode: Episode, history: FloatArray) -> str:
    driven, still = np.sqrt(np.mean(history[:, 1:] ** 2, axis=0))
    share = reduction(history)
    cells = (
        ("load error, RMS", metres(driven), _css(palette.ERROR)),
        ("drum still, RMS", metres(still), _css(_STILL)),
        ("heave reduction", "–" if math.isnan(share) else f"{100.0 * share:.1f} %", _css(palette.GOOD)),
    )
    columns = "".join(
        f'<div style="flex:1"><div style="font-size:1.25em;font-weight:700;color:{colour};white-space:nowrap">{value}'
        f'</div><div style="font-size:.72em;opacity:.7;white-space:nowrap">{label}</div></div>'
        for label, value, colour in cells
    )
    sees = "sensors" if episode.on_sensors else "full state"
    return (
        f'<div style="display:flex;gap:.5em;padding:.2em .8em">{columns}</div>'
        f'<div style="font-size:.72em;opacity:.7;padding:.1em .8em">{episode.policy.name} · sees {sees} · '
        f"{history[-1, 0]:.1f} s</div>"
    )
