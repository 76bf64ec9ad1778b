"""The 3-D scene: a block cut out of the sea, with the ship on it and the load in it.

All is drawn to scale but for the rope: of its hundreds of metres, those between two marks are left out, so that the
load's target level is always drawn at ``TARGET``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
import viser
from scipy.spatial.transform import Rotation
from trimesh.creation import icosphere

from aframe_env.rendering import palette
from aframe_env.rendering.palette import Colour
from aframe_env.rendering.scene import Scene
from aframe_env.rendering.water import Water
from aframe_env.scenario.crane import Crane
from train.demo.ship_model import (
    LOAD_SIZE,
    PULLEY_RADIUS,
    SLINGS,
    Part,
    drum_parts,
    frame_parts,
    load_outline,
    load_parts,
    pulley_parts,
    ship_parts,
)
from train.demo.solids import FloatArray, grid_faces, ring, sheet, together, tube
from train.shared.episode import Moment

TARGET: Final = -33.0
"""Height at which the load's target level is drawn, m."""
_BOTTOM: Final = -45.0
"""Height at which the ground is drawn, m."""
_X, _Y = np.linspace(-94.0, 34.0, 47), np.linspace(-30.0, 30.0, 23)
"""Grid of the sea's surface, m."""
_FALL: Final = 25.0
"""Rope that is drawn below the pulley, m."""
_RISE: Final = 8.0
"""Rope that is drawn above the hook, m."""
_LOWEST: Final = _BOTTOM + 0.5 * LOAD_SIZE[2]
_GHOST: Final[Colour] = (150, 208, 255)
_GROUND: Final[Colour] = (198, 176, 138)
_RULER_REACH: Final = 6
"""Ends of the ruler above and below the target level, m."""


@dataclass(frozen=True)
class Camera:
    """A camera's place and what it looks at, m."""

    position: tuple[float, float, float]
    look_at: tuple[float, float, float]
    width: float
    """Width that is to be seen about ``look_at``, m; a narrow picture is taken from farther away."""

    def place(self, aspect: float) -> FloatArray:
        """Place (3,) from which a picture of this width over height shows ``width``."""
        look_at = np.array(self.look_at)
        away = np.array(self.position) - look_at
        distance = 0.5 * self.width / (math.tan(0.5 * FIELD_OF_VIEW) * min(aspect, 1.2))
        return np.asarray(look_at + away * distance / float(np.linalg.norm(away)))


FIELD_OF_VIEW: Final = math.radians(32.0)
"""Vertical, rad."""
CAMERAS: Final = {
    "Overview": Camera((44.0, -150.0, 34.0), (-17.0, 0.0, -12.0), 114.0),
    "Ship": Camera((62.0, -84.0, 34.0), (-4.0, 0.0, 1.0), 58.0),
    "Load": Camera((34.0, -34.0, -25.0), (8.0, 1.5, -32.0), 21.0),
    "Upright": Camera((70.0, -120.0, -28.0), (8.0, 0.0, -53.0), 72.0),
}
"""Views by name; the last one, of the stern down to the load, is for a telephone: above the panel."""


def aim(camera: viser.CameraHandle | viser.InitialCameraConfig, view: Camera, aspect: float) -> None:
    """Turn a page's camera, or that of pages to come, to a view, for a picture of this width over height."""
    camera.fov, camera.near, camera.far = FIELD_OF_VIEW, 1.0, 2000.0
    camera.position, camera.look_at = view.place(aspect), np.array(view.look_at)


class Stage:
    """The scene on a server, which every page that is open shows."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Set it up, without a crane yet."""
        self._server, self._scene = server, server.scene
        self._crane: Crane | None = None
        scene = self._scene
        scene.configure_default_lights(enabled=True, cast_shadow=False)
        # An environment map would light every pixel anew: too dear where a browser draws without a GPU.
        scene.configure_environment_map(None)
        scene.add_light_hemisphere("/sky", sky_color=(255, 255, 255), ground_color=(120, 140, 150), intensity=3.4)
        scene.set_background_image(_backdrop(), format="png")
        self._ship = scene.add_frame("/ship", show_axes=False)
        self._add("/ship", ship_parts())
        self._loads = {}
        for name in ("load", "ghost"):
            self._loads[name] = scene.add_frame(f"/{name}", show_axes=False)
        self._add("/load", load_parts())
        self._add("/ghost", [Part("outline", _GHOST, load_outline())])
        self._add_ground()
        self._add_target()
        self._water = self._add_water()
        rope = tube((0.0, 0.0, 0.0), (0.0, 0.0, -_FALL), _ROPE_RADIUS, 6)
        self._fall = self._add_rope("/fall", Part("rope", palette.ROPE, rope))
        for name, colour, radius in (("load", palette.ROPE, _ROPE_RADIUS), ("ghost", _GHOST, 0.5 * _ROPE_RADIUS)):
            rope = tube((0.0, 0.0, SLINGS), (0.0, 0.0, SLINGS + _RISE), radius, 6)
            self._loads[f"{name}-rope"] = self._add_rope(f"/{name}-rope", Part("rope", colour, rope))
        self._gap_label = scene.add_label("/gap-label", "", anchor="center-left", font_screen_scale=0.9)
        scene.add_label(
            "/ghost/label", "drum still", position=(-0.5 * LOAD_SIZE[0] - 0.6, 0.0, 0.0), anchor="center-right"
        )

    def begin(self, crane: Crane) -> None:
        """Put up a crane."""
        if crane == self._crane:
            return
        self._crane = crane
        self._add("/ship/frame", frame_parts(crane))
        self._drum = self._scene.add_frame("/ship/drum", show_axes=False, position=crane.drum_position)
        self._add("/ship/drum", drum_parts(crane))
        x, y, z = crane.pulley_position
        self._pulley = self._scene.add_frame("/ship/pulley", show_axes=False, position=(x - PULLEY_RADIUS, y, z))
        self._add("/ship/pulley", pulley_parts())
        points = _hoist(crane)
        bars = [tube(*ends, _ROPE_RADIUS, 6) for ends in pairwise(points)]
        self._mesh("/ship/hoist", Part("rope", palette.ROPE, together(bars)))

    def show(self, moment: Moment) -> None:
        """Draw a moment, all of it in one frame."""
        scene = moment.driven
        with self._server.atomic():
            self._ship.position = scene.deck
            self._ship.wxyz = Rotation.from_matrix(scene.rotation).as_quat(scalar_first=True)
            self._drum.wxyz = _turned(scene.drum_angle)
            self._pulley.wxyz = _turned(scene.drum_angle * scene.crane.winch.drum_radius / PULLEY_RADIUS)
            driven, still = _drawn(scene), _drawn(moment.still)
            self._loads["load"].position, self._loads["ghost"].position = driven, still
            self._show_ropes(scene, driven, still)
            self._show_water(scene.water, scene.time)

    def view(self, client: viser.ClientHandle, name: str | None = None) -> None:
        """Turn one page's camera to a view; without a name to the one that suits its shape."""
        aspect = client.camera.aspect
        with client.atomic():
            client.camera.up_direction = (0.0, 0.0, 1.0)
            aim(client.camera, CAMERAS[name or ("Overview" if aspect > 0.9 else "Upright")], aspect)

    def _add(self, under: str, parts: Iterable[Part]) -> None:
        for part in parts:
            self._mesh(f"{under}/{part.name}", part)

    def _add_rope(self, name: str, part: Part) -> viser.FrameHandle:
        frame = self._scene.add_frame(name, show_axes=False)
        self._add(name, [part])
        return frame

    def _mesh(self, name: str, part: Part) -> None:
        self._scene.add_mesh_simple(
            name,
            part.mesh.vertices,
            part.mesh.faces,
            color=part.colour,
            flat_shading=True,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )

    def _add_ground(self) -> None:
        x, y = np.meshgrid(_X[::2], _Y[::3], indexing="ij")
        hills = np.random.default_rng(4).normal(0.0, 0.55, x.shape)
        top = np.stack([x, y, _BOTTOM + hills], axis=-1)
        ground = [sheet(top)]
        for edge in (top[0], top[-1], top[:, 0], top[:, -1]):
            ground.append(sheet(np.stack([edge, edge * [1.0, 1.0, 0.0] + [0.0, 0.0, _BOTTOM - 6.0]])))
        self._mesh("/ground", Part("ground", _GROUND, together(ground)))
        rng = np.random.default_rng(11)
        rocks = []
        for _ in range(16):
            rock = icosphere(subdivisions=1, radius=rng.uniform(0.8, 2.8))
            rock.vertices *= rng.uniform(0.7, 1.2, (len(rock.vertices), 1)) * [1.0, 1.0, 0.6]
            rocks.append(rock.apply_translation([rng.uniform(-92.0, 36.0), rng.uniform(-32.0, 32.0), _BOTTOM]))
        self._mesh("/rocks", Part("rocks", (150, 138, 118), together(rocks)))

    def _add_target(self) -> None:
        """Draw the ring at the target level, the ruler in metres beside it, and the place on the ground below."""
        self._target = self._scene.add_frame("/target", show_axes=False)
        self._mesh("/target/ring", Part("ring", palette.TARGET, ring(4.6, 0.16)))
        x = 5.6
        bars = [tube((x, 0.0, -_RULER_REACH), (x, 0.0, _RULER_REACH), 0.07)]
        for level in range(-_RULER_REACH, _RULER_REACH + 1):
            reach = 1.0 if level % 2 == 0 else 0.5
            bars.append(tube((x, 0.0, level), (x + reach, 0.0, level), 0.07))
            if level % 2 == 0 and abs(level) < _RULER_REACH:
                self._scene.add_label(
                    f"/target/{level}",
                    f"{level:+d} m" if level else "target",
                    position=(x + 1.4, 0.0, level),
                    anchor="center-left",
                    font_screen_scale=0.85,
                )
        self._mesh("/target/ruler", Part("ruler", palette.FOAM, together(bars)))
        place = [ring(r, 0.22).apply_translation([0.0, 0.0, _BOTTOM - TARGET + 1.0]) for r in (3.0, 5.2)]
        self._mesh("/target/place", Part("place", palette.TARGET, together(place)))

    def _add_water(self) -> dict[str, viser.MeshHandle]:
        """Add surface and sides of the block of water, still."""
        water = {}
        for name, (vertices, faces) in _block(np.zeros((len(_X), len(_Y)))).items():
            water[name] = self._scene.add_mesh_simple(
                f"/water/{name}",
                vertices,
                faces,
                color=_SURFACE if name == "surface" else _SIDES,
                opacity=0.84 if name == "surface" else 0.24,
                flat_shading=name == "surface",
                side="double",
                cast_shadow=False,
                receive_shadow=False,
            )
        return water

    def _show_water(self, water: Water, time: float) -> None:
        heights = np.stack([water.heights(_X, float(y), time) for y in _Y], axis=1)
        for name, (vertices, _) in _block(heights).items():
            self._water[name].vertices = vertices.astype(np.float32)

    def _show_ropes(self, scene: Scene, driven: FloatArray, still: FloatArray) -> None:
        """Let the drawn ends of the rope hang from the pulley and stand on the loads, in the line between them."""
        self._fall.position = scene.pulley
        for name, load in (("load", driven), ("ghost", still)):
            self._loads[f"{name}-rope"].position = load
            line = scene.pulley - load - [0.0, 0.0, SLINGS]
            self._loads[f"{name}-rope"].wxyz = _upright(line)
            if name == "load":
                self._fall.wxyz = _upright(line)
        self._fall.visible = self._loads["load-rope"].visible = not scene.parted
        left_out = scene.rope_length - scene.crane.drum_to_pulley - _FALL - _RISE
        self._gap_label.text = "rope parted" if scene.parted else f"{left_out:.0f} m of rope left out"
        self._gap_label.position = (scene.crane.pulley_position[0] + 0.8, 0.0, TARGET + SLINGS + _RISE + 2.5)
        self._target.position = (scene.crane.pulley_position[0], 0.0, TARGET)


_ROPE_RADIUS: Final = 0.14
_SURFACE: Final[Colour] = (38, 132, 168)
_SIDES: Final[Colour] = (40, 140, 190)


def _block(heights: FloatArray) -> dict[str, tuple[FloatArray, np.ndarray]]:
    """Vertices and triangles of the water's surface and of its sides, for heights on the grid (x, y)."""
    x, y = np.meshgrid(_X, _Y, indexing="ij")
    top = np.stack([x, y, heights], axis=-1)
    rim = np.concatenate([top[:, 0], top[-1, 1:], top[-2::-1, -1], top[0, -2::-1]])
    foot = rim.copy()
    foot[:, 2] = _BOTTOM
    return {
        "surface": (top.reshape(-1, 3), grid_faces(len(_X), len(_Y))),
        "sides": (np.concatenate([rim, foot]), grid_faces(2, len(rim))),
    }


def _drawn(scene: Scene) -> FloatArray:
    """Where the load is drawn: at its place beside the pulley's, its depth error below or above ``TARGET``."""
    x, y, _ = scene.load
    return np.array([x, y, max(TARGET + scene.depth_error, _LOWEST)])


def _turned(angle: float) -> FloatArray:
    """Turn about y as the drum pays out rope outboard over its top, as a quaternion wxyz."""
    return np.array([math.cos(0.5 * angle), 0.0, math.sin(0.5 * angle), 0.0])


def _upright(line: FloatArray) -> FloatArray:
    """Least turn of z into a line's direction (3,), as a quaternion wxyz."""
    x, y, z = line / np.linalg.norm(line)
    turn = np.array([1.0 + z, -y, x, 0.0])
    return np.asarray(turn / np.linalg.norm(turn))


def _hoist(crane: Crane) -> FloatArray:
    """Points of the rope in the deck frame from the drum's top over the pulley to where it falls, (n, 3)."""
    drum, pulley = np.array(crane.drum_position), np.array(crane.pulley_position)
    hub = pulley - [PULLEY_RADIUS, 0.0, 0.0]
    span = hub - drum
    along = math.atan2(span[2], span[0])
    # The rope touches both circles on the side away from the ship's deck.
    side = along + math.acos((crane.winch.drum_radius - PULLEY_RADIUS) / float(np.hypot(span[0], span[2])))
    over = np.linspace(side, 0.0, 10)
    wrap = hub + PULLEY_RADIUS * np.stack([np.cos(over), np.zeros(len(over)), np.sin(over)], axis=1)
    start = drum + crane.winch.drum_radius * np.array([math.cos(side), 0.0, math.sin(side)])
    return np.concatenate([[start], wrap])


def _backdrop() -> np.ndarray:
    """Sky as a gradient, (height, 2, 3) uint8."""
    stops = np.array([(150, 196, 226), (214, 231, 240), (240, 244, 243), (222, 232, 238)], dtype=np.float64)
    share = np.linspace(0.0, 1.0, 256)
    channels = [np.interp(share, [0.0, 0.42, 0.62, 1.0], stops[:, k]) for k in range(3)]
    return np.repeat(np.stack(channels, axis=1)[:, None], 2, axis=1).astype(np.uint8)
