"""The live page itself: viser's scene and controls. The only module that imports viser, and it decides nothing."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Mapping, Sequence
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
"""Of the eye, from top to bottom [rad]."""

_EYE = np.array([0.9, -1.6, 1.25])
"""Direction from the middle of the scene to the eye."""


class LivePage:
    """A page in every browser that opens it; all of them show the same.

    Attributes:
        url: where it is.
    """

    def __init__(self, port: int, middle: Vectors, size: float) -> None:
        with contextlib.redirect_stdout(io.StringIO()), guarded():  # it greets
            self._server = viser.ViserServer(host="127.0.0.1", port=port, label="tanteo", verbose=False)
        # the button that asks for a tunnel through somebody else's machine is not shown; nor may a page ask for it
        self._server.request_share_url = _no_tunnel
        self.url = f"http://127.0.0.1:{self._server.get_port()}"
        self._gui, self._scene = self._server.gui, self._server.scene
        self._gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(0, 114, 178))
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
        """Light from above and in front, and some from everywhere; viser's own picture of a place costs too much."""
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
        """Everything with which a session is played."""
        self._place("status")
        for commands in _BUTTONS:
            buttons = self._gui.add_button_group("", tuple(commands))
            buttons.on_click(lambda event, commands=commands: send(commands[event.target.value]))
        self._place("bars")
        self._legend(hand=hand, scene=True)
        with self._gui.add_folder("How"):
            choice = self._gui.add_dropdown("Policy", tuple(policies), initial_value=policy)
            choice.on_update(lambda event: send(Choose(policy=event.target.value)))
            speed = self._gui.add_dropdown("Speed", tuple(_SPEEDS), initial_value="3 times")
            speed.on_update(lambda event: send(Choose(speed=_SPEEDS[event.target.value])))
            number = self._gui.add_number(
                "Seed", seed, min=0, step=1, hint="Of all simulated errors; holds from the next restart."
            )
            number.on_update(lambda event: send(Choose(seed=int(event.target.value or 0))))
        self._happened()
        self._scene.on_click()(
            lambda event: send(
                Click(np.array(event.ray_origin), np.array(event.ray_direction), frozenset(self._hidden))
            )
        )

    def record_controls(self, send: Callable[[int], None], count: int, *, hand: bool) -> None:
        """A slider over what was recorded."""
        self._place("status")
        slider = self._gui.add_slider("Step", min=0, max=count, step=1, initial_value=count)
        slider.on_update(lambda event: send(int(event.target.value)))
        self._place("bars")
        self._legend(hand=hand, scene=False)
        self._happened()

    def looking_controls(self) -> None:
        """What is said and drawn of a session that is carried out elsewhere."""
        self._place("status")
        self._place("bars")
        self._legend(hand=False, scene=False)
        self._happened()

    def _happened(self) -> None:
        with self._gui.add_folder("What happened", expand_by_default=False):
            self._place("told")

    def _legend(self, *, hand: bool, scene: bool) -> None:
        """What is drawn, what it means, and boxes that show and hide it."""
        there = {"hand": hand, "planner": scene}
        with self._gui.add_folder("What is drawn"):
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

    def say(self, place: str, html: str) -> None:
        """Put words in place of those that were there."""
        self._words[place].content = html

    def show(self, group: str, primitives: Sequence[Primitive]) -> None:
        """Draw these in place of those of the same group."""
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
        """Close it."""
        with contextlib.redirect_stdout(io.StringIO()):  # it says so
            self._server.stop()


def seen_from(middle: Vectors, size: float, aspect: float) -> tuple[Vectors, Vectors]:
    """Where the eye is, and where it looks, so that something is seen beside the controls; world [m].

    Args:
        middle: of what is to be seen ``(3,)``.
        size: of it.
        aspect: width of the window by its height: controls are on the right, or below where it is narrow.
    """
    forward = -_EYE / np.linalg.norm(_EYE)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    if aspect > 1:
        away, aside = 2.0 * size, 0.1 * aspect * right
    else:
        away, aside = 1.5 * size / aspect, -0.2 * np.cross(right, forward)
    look_at = middle + 2 * away * np.tan(FOV / 2) * aside
    return look_at - away * forward, look_at


def _fitted(client: viser.ClientHandle, middle: Vectors, size: float) -> None:
    """A narrow window has another eye than the usual one."""
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
    """The page stays on this machine."""
