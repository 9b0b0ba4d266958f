"""Live page with the scene and the controls of viser; only this module imports viser."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import viser

from tanteo.geometry import SO3
from tanteo.geometry.typing import Transforms, Vectors
from tanteo.render.live.commands import Advance, AnswerNow, Choose, Click, Command, Contest, Go, Pause, Restart
from tanteo.render.live.drawing import HIDDEN_AT_FIRST, LAYERS
from tanteo.render.live.gate import guarded
from tanteo.render.live.panel import GRID, STYLE, legend, sign
from tanteo.render.live.primitives import Arrow, Dots, Label, Lines, Mesh, Primitive

_BUTTONS: tuple[Mapping[str, Command], ...] = (
    {"Go": Go(), "Step": Advance(), "Pause": Pause(), "Restart": Restart()},
    {"You against the planner": Contest(), "Answer now": AnswerNow()},
)
_SPEEDS = {"real time": 1.0, "3 times": 3.0, "10 times": 10.0, "at once": np.inf}
FOV = float(np.radians(45.0))
"""Vertical field of view [rad]."""

_THEME: Mapping[str, Any] = MappingProxyType(
    {"show_logo": False, "show_share_button": False, "brand_color": (0, 114, 178)}
)

_EYE = np.array([0.9, -1.6, 1.25])
"""Direction from the centre of the scene to the viewer, world frame."""


class LivePage:
    """Page of viser, with the same content in every browser that opens it.

    Attributes:
        url: address of the page.
    """

    def __init__(self, port: int, middle: Vectors, size: float) -> None:
        with contextlib.redirect_stdout(io.StringIO()), guarded():  # suppresses its greeting
            self._server = viser.ViserServer(host="127.0.0.1", port=port, label="tanteo", verbose=False)
        # no public tunnel: neither its button nor a request of a page
        self._server.request_share_url = _no_tunnel
        self.url = f"http://127.0.0.1:{self._server.get_port()}"
        self._gui, self._scene = self._server.gui, self._server.scene
        self._gui.configure_theme(**_THEME)
        self._gui.add_html(STYLE)
        self._light()
        self._shown: dict[str, dict[str, tuple[Primitive, Any]]] = {}
        self._hidden: set[str] = set(HIDDEN_AT_FIRST)
        self._words: dict[str, Any] = {}
        camera = self._server.initial_camera
        camera.position, camera.look_at = seen_from(middle, size, 1.6)
        camera.fov, camera.near, camera.far = FOV, 0.005, 50.0
        self._server.on_client_connect(lambda client: _fitted(client, middle, size))
        self._grid(middle, size)

    def _light(self) -> None:
        """Set directional and ambient light; the environment map of viser is too slow."""
        self._scene.configure_default_lights(enabled=False)
        self._scene.configure_environment_map(None)
        self._scene.add_light_hemisphere("/sky", sky_color=(255, 255, 255), ground_color=(170, 165, 160), intensity=3.0)
        self._scene.add_light_directional("/sun", position=(0.5, -1.0, 2.0), intensity=1.6, cast_shadow=False)

    def _grid(self, middle: Vectors, size: float) -> None:
        width = float(np.ceil(4 * size / 0.1) * 0.1)
        self._scene.add_grid(
            "/grid", width=width, height=width, cell_size=GRID, section_size=10 * GRID, cell_color=(205, 211, 217),
            section_color=(205, 211, 217), position=(middle[0], middle[1], 0.0005), plane="xy",
        )  # fmt: skip

    def session_controls(
        self, send: Callable[[Command], None], policies: Sequence[str], policy: str, seed: int, *, hand: bool
    ) -> None:
        """Add the controls of a running session.

        Args:
            send: function that receives the commands of the user.
            policies: names of the policies to choose from.
            policy: name of the chosen policy.
            seed: seed of the session.
            hand: whether the session has a hand.
        """
        self._place("status")
        for commands in _BUTTONS:
            buttons = self._gui.add_button_group("", tuple(commands))
            buttons.on_click(lambda event, commands=commands: send(commands[event.target.value]))
        self._place("bars")
        self._legend(hand=hand, scene=True)
        with self._gui.add_folder("Settings"):
            choice = self._gui.add_dropdown("Policy", tuple(policies), initial_value=policy)
            choice.on_update(lambda event: send(Choose(policy=event.target.value)))
            speed = self._gui.add_dropdown("Speed", tuple(_SPEEDS), initial_value="3 times")
            speed.on_update(lambda event: send(Choose(speed=_SPEEDS[event.target.value])))
            number = self._gui.add_number(
                "Seed", seed, min=0, step=1, hint="Seed of all simulated errors; used from the next restart."
            )
            number.on_update(lambda event: send(Choose(seed=int(event.target.value or 0))))
        self._happened()
        self._scene.on_click()(
            lambda event: send(
                Click(np.array(event.ray_origin), np.array(event.ray_direction), frozenset(self._hidden))
            )
        )

    def record_controls(self, send: Callable[[int], None], count: int, *, hand: bool) -> None:
        """Add the controls of a record: a slider over its steps.

        Args:
            send: function that receives the number of the chosen step.
            count: number of steps.
            hand: whether the record has a hand.
        """
        self._place("status")
        slider = self._gui.add_slider("Step", min=0, max=count, step=1, initial_value=count)
        slider.on_update(lambda event: send(int(event.target.value)))
        self._place("bars")
        self._legend(hand=hand, scene=False)
        self._happened()

    def viewing_controls(self) -> None:
        """Add the panels of a session that runs elsewhere, without controls."""
        self._place("status")
        self._place("bars")
        self._legend(hand=False, scene=False)
        self._happened()

    def _happened(self) -> None:
        with self._gui.add_folder("Steps so far", expand_by_default=False):
            self._place("steps")
        dark = self._gui.add_checkbox("Dark page", initial_value=False, hint="?darkMode in the address does the same.")
        dark.on_update(lambda event: self._gui.configure_theme(**_THEME, dark_mode=event.target.value))

    def _legend(self, *, hand: bool, scene: bool) -> None:
        """Add the legend with a box for each layer."""
        there = {"hand": hand, "planner": scene}
        with self._gui.add_folder("Legend"):
            self._gui.add_html(legend(scene=scene))
            for layer, words in LAYERS.items():
                if there.get(layer, True):
                    self._gui.add_html(sign(layer))
                    box = self._gui.add_checkbox(words, initial_value=layer not in HIDDEN_AT_FIRST)
                    box.on_update(lambda event, layer=layer: self._hide(layer, hidden=not event.target.value))

    def _place(self, name: str) -> None:
        self._words[name] = self._gui.add_html("")

    def _hide(self, layer: str, *, hidden: bool) -> None:
        (self._hidden.add if hidden else self._hidden.discard)(layer)
        for group in list(self._shown.values()):
            for primitive, handle in list(group.values()):
                if primitive.layer == layer:
                    handle.visible = not hidden

    def set_text(self, place: str, html: str) -> None:
        """Replace the text of a panel.

        Args:
            place: name of the panel.
            html: new content, escaped HTML.
        """
        self._words[place].content = html

    def show(self, group: str, primitives: Sequence[Primitive]) -> None:
        """Replace the primitives of a group.

        Args:
            group: name of the group.
            primitives: new content of the group.
        """
        old, new = self._shown.get(group, {}), dict[str, tuple[Primitive, Any]]()
        with self._server.atomic():
            for p in primitives:
                before = old.pop(p.name, None)
                if before is not None and isinstance(p, Mesh | Lines) and p.same_shape(before[0]):
                    new[p.name] = p, _moved(before[1], p)
                else:
                    new[p.name] = p, self._add(f"/{group}/{p.name.replace('/', ' ')}", p)
            for _, handle in old.values():
                handle.remove()
        self._shown[group] = new

    def _add(self, name: str, p: Primitive) -> Any:
        scene, visible = self._scene, p.layer not in self._hidden
        if isinstance(p, Mesh):
            return scene.add_mesh_simple(
                name, p.vertices, p.triangles, color=p.colour, opacity=None if p.opacity >= 1 else p.opacity,
                flat_shading=True, side="double" if p.opacity < 1 else "front", cast_shadow=False, receive_shadow=False,
                visible=visible, **_pose(p.T),
            )  # fmt: skip
        if isinstance(p, Lines):
            return scene.add_line_segments(
                name, p.segments, p.colour, thickness=p.width, thickness_units="screen", visible=visible, **_pose(p.T)
            )
        if isinstance(p, Dots):
            return scene.add_point_cloud(
                name, p.points, p.colour, point_size=p.size, point_shape=p.shape, precision="float32",
                point_shading="flat", visible=visible,
            )  # fmt: skip
        if isinstance(p, Arrow):
            return scene.add_arrows(
                name, np.stack([p.start, p.end])[None], p.colour, shaft_radius=p.radius, head_radius=2.5 * p.radius,
                head_length=7 * p.radius, visible=visible,
            )  # fmt: skip
        assert isinstance(p, Label)
        return scene.add_label(name, p.text, position=tuple(p.place), anchor="bottom-center", visible=visible)

    def stop(self) -> None:
        """Close the page."""
        with contextlib.redirect_stdout(io.StringIO()):  # suppresses its message
            self._server.stop()


def seen_from(middle: Vectors, size: float, aspect: float) -> tuple[Vectors, Vectors]:
    """Return position and target of the camera with which the whole scene is visible beside the controls.

    Both are in the world frame [m].

    Args:
        middle: centre of the scene ``(3,)`` [m].
        size: size of the scene [m].
        aspect: width of the window over its height; controls are on the right, or below in a narrow window.
    """
    forward = -_EYE / np.linalg.norm(_EYE)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    if aspect > 1:
        away, offset = 2.0 * size, 0.1 * aspect * right
    else:
        away, offset = 1.5 * size / aspect, -0.2 * np.cross(right, forward)
    target = middle + 2 * away * np.tan(FOV / 2) * offset
    return target - away * forward, target


def _fitted(client: viser.ClientHandle, middle: Vectors, size: float) -> None:
    """Set another view for a narrow window."""
    if client.camera.aspect < 1:
        client.camera.position, client.camera.look_at = seen_from(middle, size, client.camera.aspect)


def _pose(T: Transforms) -> dict[str, Any]:
    return {"wxyz": SO3.as_quaternion(T[:3, :3]), "position": T[:3, 3]}


def _moved(handle: Any, p: Mesh | Lines) -> Any:
    pose = _pose(p.T)
    handle.position, handle.wxyz = pose["position"], pose["wxyz"]
    if isinstance(p, Mesh) and p.opacity < 1:
        handle.opacity = p.opacity
    return handle


def _no_tunnel(verbose: bool = True) -> None:
    """Refuse to open a public tunnel."""
