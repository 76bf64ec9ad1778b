"""The scalar environment, AFrameHeave-v0."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.envs.registration import EnvSpec

from aframe_env import task
from aframe_env.config import TaskConfig, plain_spec, task_config
from aframe_env.rendering import open_renderer
from aframe_env.scenario import Scenario
from aframe_env.simulation import RowState, Simulation
from aframe_env.validation import InvalidValue, require_choice, require_numbers

if TYPE_CHECKING:
    from aframe_env.rendering.renderer import Renderer

_ROW = np.zeros(1, dtype=np.int64)


@dataclass(frozen=True)
class EnvState:
    """Everything that the rest of an environment's life depends on: the row and the generator."""

    row: RowState
    generator: Mapping[str, Any]


class AFrameHeaveEnv(gymnasium.Env[npt.NDArray[np.float32], npt.NDArray[np.float32]]):
    """Hold a load still at depth while the ship heaves, by turning the winch drum.

    ## Description
    A load of 20 to 100 t hangs on an elastic rope from an A-frame at the stern of a ship in a random sea. The drum
    pays rope out and in. The load shall stay at its required level h. The model is the simplified one of
    Adamiec-Wójcik, Fałat, Maczyński and Wojciech (2009), eqs. (37)-(41): rigid frame, six-degree-of-freedom ship
    motion, the load a particle on a rope that is elastic, damped and cannot push; or, with `model="rfem"`, their full
    one, eqs. (1)-(30), with the frame a chain of rigid finite elements.

    Axes: x outboard (aft), z up, y to the left of somebody who looks outboard; origin at the mean place of the deck
    frame, midway between the frame's feet. SI units, angles in radians.

    ## Action space
    `Box(-w, w, (1,), float32)`: commanded angular velocity of the drum, rad/s; positive pays out. w is the winch's
    limit (4 rad/s, that is 3 m/s of rope, for the reference crane); where winches are drawn, that of the fastest. The
    drum follows the command within its limits of speed and acceleration (2 m/s² of rope) and its lag; the observation
    has the actual speed. At the least and greatest paid-out length the limit switches stop the drum.

    ## Observation space
    `observation="state"` (default), `Box(14,) float32`, values beyond a range are clipped to it:

    | # | symbol | meaning | unit | range |
    | --- | --- | --- | --- | --- |
    | 0 | x_L3 - h | depth error of the load | m | ±1e3 |
    | 1 | x'_L3 | vertical velocity of the load | m/s | ±100 |
    | 2, 3 | x_L1 - x_S1, x_L2 - x_S2 | horizontal offset of the load from the pulley | m | ±1e3 |
    | 4, 5 | x'_L1, x'_L2 | horizontal velocity of the load | m/s | ±100 |
    | 6 | x_S3 - x_S3(rest) | heave of the pulley S | m | ±100 |
    | 7 | x'_S3 | vertical velocity of the pulley | m/s | ±100 |
    | 8 | x''_S3 | vertical acceleration of the pulley | m/s² | ±100 |
    | 9 | φ_H | drum angle, from the start | rad | ±1e5 |
    | 10 | φ'_H | actual drum speed | rad/s | ±1e3 |
    | 11 | T | rope tension, on the drum's side of the pulley | N | 0 ... 1e8 |
    | 12 | m_L | mass of the load, in air, as told | kg | 0 ... 1e7 |
    | 13 | l | unstretched rope length between drum and load | m | 0 ... 1e5 |

    `observation="sensors"`, or a `Sensors` of your own, `Box(10,) float32`: what instruments read, with noise, delay,
    sampling and resolution (see `Sensors`):

    | # | meaning | unit | range |
    | --- | --- | --- | --- |
    | 0 | heave of the pulley, by the motion reference unit | m | ±100 |
    | 1 | vertical velocity of the pulley, likewise | m/s | ±100 |
    | 2, 3 | roll and pitch of the ship, likewise | rad | ±π |
    | 4 | drum angle, by its encoder | rad | ±1e5 |
    | 5 | drum speed | rad/s | ±1e3 |
    | 6 | rope tension on the drum's side of the pulley, by a load pin | N | ±1e8 |
    | 7 | depth error of the load, by a transponder or from the rope: slow and coarse | m | ±1e3 |
    | 8 | mass of the load, in air, as told | kg | 0 ... 1e7 |
    | 9 | unstretched rope length at the start | m | 0 ... 1e5 |

    With `Sensors(preview=Preview())`, as in the task Preview, the heave of the pulley that a wave radar foretells comes
    after these, m, ±100: at 0.5 s, 1 s, ... 15 s from now, in all `Box(40,) float32`.

    ## Reward
    Minus the integral of (x_L3 - h)² over the control step, m² s: the return of an episode is exactly -Ω1, eq. (31).

    ## Starting state
    The load hangs at rest on its rope below the pulley, with the rope length that puts it at h when the ship is at
    rest; the drum stands still. In drawn scenarios the ship's motion builds up over the first 10 s.

    ## Episode end
    - Truncation: after `episode_duration`.
    - Termination: the rope's tension passed its breaking load and the load is lost. It then falls freely, and the
      last reward includes what that costs until the end of the episode, and for at least 10 s: to lose the load
      never pays.

    ## Information
    Arrays, of shape () where no other is named: `time` [s], `load_position` (3,) [m], `rope_tension` [N], `slack` (the
    rope was slack within the last step), `omega1` [m² s] and `omega2` [m] so far, eqs. (31), (32). `rope_tension` is
    that on the drum's side of the pulley, `load_tension` [N] that at the load. `target_level` [m] is h at the time. On
    a seabed, `landings` and `lift_offs` are counted so far, `landing_speed` [m/s] is the greatest of all landings, and
    `contact_force` [N] the greatest within the last step. `pulley_position` (3,) [m] is that of S with the frame rigid,
    `luffing_angle` [rad] the frame's at the time.
    `contact_force` [N] the greatest within the last step. Of a drive (`Winch(drive=TorqueDrive())`, else 0)
    `drive_torque` [N m] is the torque at the drum, positive paying out, and `drive_power` [W] what the motors give.

    With `model="rfem"` also, vectors along the deck's axes: `pulley_deflection` (3,) [m] of S on the frame;
    `foot_reactions` (2, 3) [N], forces on the frame at A_R and A_L; `servomotor_tensions` (2,) [N] of S_R and S_L;
    `utilisation`, the largest von Mises stress between two rfes over the yield strength. The pulley of the
    observation is the one of the rigid frame in both models: it is what a motion reference unit on the deck tells.
    The full model takes the rotation of an rfe to be small: the first one above 0.05 rad makes a
    `SmallRotationWarning` with the figure.

    ## Arguments
    By keyword, as in `gymnasium.make("AFrameHeave-v0", control_period=0.2)`, or together as `config=TaskConfig(...)`:

    - `task`: name of a task of the suite, as in `task="Storm"`, which is what `gymnasium.make("AFrameHeave-Storm-v0")`
      says: its scenarios, observation, control period and duration stand for what is not given.
    - `model`: "simplified" or "rfem".
    - `rfes`: with "rfem", elements of a leg and of the top beam (default `(60, 50)`; the beam's even).
    - `rfem_modes`: with "rfem", how many natural modes to keep beside the static shapes; default 16, enough for a load
      that starts with a jerk. With 5 the forces are within 0.6 % of their range of those with 60, in seas that build
      up over some seconds, the drum moving; a rope that goes slack and snaps makes a frame ring, which shows in some
      percent of the forces with 16 too.
    - `scenario`: a `Scenario` for every episode, or the `ScenarioDistribution` to draw from; or either as a TOML file,
      or as a mapping of what such a file says. Default: Hs 0.5-4 m, Tp 6-14 s, any heading, load 20-100 t, rope
      50-1500 m.
    - `control_period`: 0.001 to 2 s (default 0.1).
    - `episode_duration`: s (default 60).
    - `observation`: "state", "sensors", or a `Sensors`, also as a mapping of its fields.
    - `max_inner_step`: s; overrides the choice of the integrator's step.
    - `max_episode_steps`: overrides `episode_duration`; also as `gymnasium.make` takes it.
    - `render_mode`: None (default); "rgb_array": `render()` returns a picture, (640, 960, 3) uint8; "human": every
      reset and step shows one in a window. Needs the extra `render`, from the first picture on; with that one begins
      the history that the pictures show.

    `spec` has the arguments as plain data: `EnvSpec.from_json(env.spec.to_json())` makes the same task again. A vessel
    or a record that was not read from a file has no such form.

    `reset(options={"scenario": ...})` takes a `Scenario` for the one episode.
    """

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        "render_modes": ["human", "rgb_array"],
        "render_fps": 10,
    }

    def __init__(
        self,
        config: TaskConfig | Mapping[str, Any] | None = None,
        *,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        if render_mode is not None:
            require_choice("render_mode", render_mode, tuple(self.metadata["render_modes"]))
        steps = _steps_asked_of_gymnasium() if max_episode_steps is None else max_episode_steps
        self._simulation = Simulation(1, task_config(config, arguments).lasting(steps))
        self._spec: EnvSpec | None = None
        self.observation_space = self._simulation.observation_space  # type: ignore[assignment]
        self.action_space = self._simulation.action_space
        self.render_mode = render_mode
        # The ship heaves on the screen as fast as at sea.
        self.metadata = {**self.metadata, "render_fps": 1.0 / self.control_period}  # type: ignore[misc]
        self._renderer: Renderer | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the renderer: a copy opens its own, whose history begins anew."""
        return {**self.__dict__, "_renderer": None}

    @property
    def spec(self) -> EnvSpec | None:
        """What makes the environment again, as plain data."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = plain_spec(spec, self._simulation.config)

    @property
    def simulation(self) -> Simulation:
        """The simulation behind the environment, for reading."""
        return self._simulation

    @property
    def scenario(self) -> Scenario:
        """The present episode's scenario, the true one; what a policy may know is its ``as_told``."""
        scenario = self._simulation.scenarios[0]
        if scenario is None:
            raise gymnasium.error.ResetNeeded("no scenario before the first reset()")
        return scenario

    @property
    def control_period(self) -> float:
        """s."""
        return self._simulation.control_period

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[npt.NDArray[np.float32], dict[str, Any]]:
        """Start an episode; ``options={"scenario": Scenario}`` fixes what it is."""
        super().reset(seed=seed)
        drawn = self._simulation.draw(self.np_random, _scenario_option(options))
        self._simulation.reset_rows(_ROW, [drawn])
        self._draw()
        return self._simulation.observe()[0], self._info()

    def step(
        self, action: npt.NDArray[np.float32]
    ) -> tuple[npt.NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Advance by one control step with ``action`` (1,) rad/s held."""
        simulation = self._simulation
        if simulation.scenarios[0] is None:
            raise gymnasium.error.ResetNeeded("step() before the first reset()")
        command = require_numbers("action", action, "rad/s")
        if command.shape != (1,):
            raise InvalidValue(f"action of shape {command.shape}: must be of shape (1,), rad/s")
        if not np.isfinite(command[0]):
            limit = float(self.action_space.high[0])  # type: ignore[attr-defined]
            raise InvalidValue(f"action = {action!r} rad/s: must be finite, in [{-limit:g}, {limit:g}]")
        simulation.advance(command)
        self._draw()
        truncated = bool(simulation.steps[0] >= simulation.episode_steps)
        return (
            simulation.observe()[0],
            -float(simulation.results[0, task.COST]),
            bool(simulation.results[0, task.PARTED] > 0.0),
            truncated,
            self._info(),
        )

    def get_state(self) -> EnvState:
        """Return everything that the rest of the episode, and the draws of later ones, depend on."""
        return EnvState(self._simulation.copy_row(0), self.np_random.bit_generator.state)

    def set_state(self, state: EnvState) -> None:
        """Go back to a state that ``get_state`` returned, in this environment or one of the same arguments."""
        self._simulation.write_row(0, state.row)
        self.np_random.bit_generator.state = state.generator
        self._draw()

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Return the picture of the present in render mode "rgb_array"; show it in "human"."""
        if self.render_mode is None:
            gymnasium.logger.warn(
                "render() without a render mode: give one when making the environment, "
                'as in gymnasium.make("AFrameHeave-v0", render_mode="rgb_array")'
            )
            return None
        if self._renderer is None:
            self._renderer = open_renderer(self._simulation)
        if self.render_mode == "human":
            self._renderer.show(self.metadata["render_fps"])
            return None
        return self._renderer.frame()

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()

    def _draw(self) -> None:
        """Add the present to the pictures' history, if there is one yet, and show it in render mode "human"."""
        if self._renderer is not None:
            self._renderer.record()
        if self.render_mode == "human":
            self.render()

    def _info(self) -> dict[str, Any]:
        found = task.info(self._simulation.results.copy(), self._simulation.frames())
        return {name: value[0, ...] for name, value in found.items()}


def _steps_asked_of_gymnasium() -> int | None:
    """``max_episode_steps`` of the ``gymnasium.make`` that constructs the environment; None: none, or no such call.

    Gymnasium keeps it to itself and cuts the episode from outside, so that a longer one than ours could not be had, and
    a load that is lost would be charged for the wrong time.
    """
    frame = inspect.currentframe()
    for _ in range(2):
        frame = frame and frame.f_back
    if frame is None or frame.f_code is not gymnasium.make.__code__:
        return None
    asked = frame.f_locals["max_episode_steps"]
    steps = frame.f_locals["env_spec"].max_episode_steps if asked is None else asked
    return None if steps == -1 else steps


def _scenario_option(options: dict[str, Any] | None) -> Any:
    if not options:
        return None
    unknown = set(options) - {"scenario"}
    if unknown:
        raise InvalidValue(f"options: unknown key {sorted(unknown)[0]!r}: must be 'scenario'")
    return options.get("scenario")
