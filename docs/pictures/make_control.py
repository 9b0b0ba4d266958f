"""Draw the answers of the control law: ``python docs/pictures/make_control.py [folder]`` (matplotlib, extra ``bench``).

``step_response.svg``: the hand is 10 mm too high and 20 degrees askew over a plate; height and tilt while it converges,
for latencies from 0 to 100 ms. ``bend.svg``: it follows a surface over a bend of 45 degrees, outwards and inwards. The
hand is simulated with its errors. The program prints a table of the stability margins.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("svg")
import matplotlib.pyplot as plt
import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.hand import Hand, gripper_body
from tanteo.hand.motion import Loop, Rules, align, follow
from tanteo.hand.simulator import Cell, Scene, SimulatedHand, box, clearances
from tanteo.io import read_rig

HERE = Path(__file__).resolve().parent
LATENCIES = (0.0, 0.02, 0.05, 0.1)
STYLES = (("#0072b2", "-"), ("#2dae5b", "--"), ("#e69f00", "-."), ("#7d12d9", ":"))
STANDOFF, RULES = 0.02, Rules(clearance=0.012)
THIN = 5
"""Number of path points for each drawn point."""

RIG = read_rig("paper-gripper")
HAND = Hand(RIG, gripper_body(RIG))


def over(x: float, height: float, tilt: float = 0.0) -> np.ndarray:
    """Return the pose of the hand pointing down, with its front over a position."""
    R = np.diag([1.0, -1.0, -1.0]) @ SO3.axis_rotation(1, tilt)
    return SE3.from_parts(R, np.array([x, 0.0, height]) - R @ HAND.front)


def step_with(latency: float, assumed: float) -> tuple[np.ndarray, np.ndarray]:
    """Return times, and height and tilt, for a true latency and the latency that the control law assumes."""
    plate = Scene.of([box("plate", [-0.2, -0.2, -0.02], [0.2, 0.2, 0.0])])
    cell = Cell(latency=latency)
    robot = SimulatedHand(
        plate, HAND, over(0, STANDOFF + 0.01, math.radians(20)), rng=np.random.default_rng(0), cell=cell
    )
    reported = MisreportedLatency(robot, assumed)
    align(reported, STANDOFF, Rules(clearance=0.008, timeout=2.0))
    Ts = np.array(robot.truth)
    heights = Ts[:, 2, 3] + (Ts[:, :3, :3] @ HAND.front)[:, 2]
    return 0.01 * np.arange(len(Ts)), np.stack([1e3 * heights, np.degrees(np.arcsin(-Ts[:, 2, 0]))])


class MisreportedLatency:
    """Robot that reports a latency other than its true one."""

    def __init__(self, robot: SimulatedHand, latency: float) -> None:
        self._robot, self.latency = robot, latency
        self.hand, self.period = robot.hand, robot.period

    @property
    def sensed(self):
        """Last readings of the robot."""
        return self._robot.sensed

    def step(self, twist):
        """Run one period."""
        return self._robot.step(twist)


def step_response(folder: Path) -> None:
    """Draw height and tilt over time after a step."""
    figure, axes = plt.subplots(1, 2, figsize=(9.6, 3.4), constrained_layout=True)
    for latency, (colour, style) in zip(LATENCIES, STYLES, strict=True):
        times, both = step_with(latency, latency)
        for axis, values in zip(axes, both, strict=True):
            axis.plot(times, values, color=colour, ls=style, label=f"{1e3 * latency:.0f} ms")
    axes[0].axhline(1e3 * STANDOFF, color="#8a97a3", lw=0.8, zorder=0)
    axes[1].axhline(0, color="#8a97a3", lw=0.8, zorder=0)
    name_line(axes[0], 1e3 * STANDOFF, "stand-off")
    axes[0].set(xlabel="time [s]", ylabel="height of the front [mm]")
    axes[1].set(xlabel="time [s]", ylabel="tilt [deg]")
    axes[1].legend(title="latency", frameon=False)
    save(figure, folder / "step_response.svg")


def name_line(axis: plt.Axes, height: float, words: str) -> None:
    """Write the name of a level line at its right end."""
    place = axis.get_yaxis_transform()
    axis.annotate(words, (0.985, height), (0, 4), place, "offset points", ha="right", fontsize="small")


def bend(folder: Path) -> list[tuple[int, float, float, float]]:
    """Draw the paths of the front over both bends, and return the smallest clearance of each."""
    figure, axes = plt.subplots(2, 2, figsize=(9.6, 6.4), constrained_layout=True)
    rows = []
    for k, angle in enumerate((45, -45)):
        slope = SE3.from_parts(SO3.axis_rotation(1, math.radians(angle)), np.zeros(3))
        flat = box("flat", [-0.1, -0.1, -0.02], [0, 0.1, 0])
        scene = Scene.of([flat, box("slope", [0, -0.1, -0.02], [0.2, 0.1, 0], slope)])
        end = 90 * np.array([math.cos(math.radians(angle)), -math.sin(math.radians(angle))])
        axes[k, 0].plot([-70, 0, end[0]], [0, 0, end[1]], color="#22303c", lw=2, label="surface")
        for latency, (colour, style) in zip(LATENCIES, STYLES, strict=True):
            robot = SimulatedHand(
                scene, HAND, over(-0.05, STANDOFF), rng=np.random.default_rng(1), cell=Cell(latency=latency)
            )
            motion = follow(robot, [1, 0, 0], 0.14, STANDOFF, RULES)
            Ts = np.array(robot.truth)
            fronts = 1e3 * (Ts[:, :3, 3] + Ts[:, :3, :3] @ HAND.front)
            clear = 1e3 * clearances(scene, HAND.body, Ts)
            name = "_" if latency else "front of the hand"
            axes[k, 0].plot(fronts[::THIN, 0], fronts[::THIN, 2], color=colour, ls=style, label=name)
            path = np.concatenate([[0], np.linalg.norm(np.diff(fronts, axis=0), axis=1).cumsum()])
            axes[k, 1].plot(
                path[::THIN],
                clear[::THIN],
                color=colour,
                ls=style,
                label=f"{1e3 * latency:.0f} ms, {motion.seconds:.1f} s",
            )
            rows.append((angle, latency, clear.min(), motion.seconds))
        axes[k, 0].set(aspect="equal", xlabel="x [mm]", ylabel="z [mm]", title=f"bend of {angle} degrees outwards")
        axes[k, 1].axhline(1e3 * STANDOFF, color="#8a97a3", lw=0.8, zorder=0)
        axes[k, 1].axhline(0.5e3 * STANDOFF, color="#8a97a3", lw=0.8, ls="--", zorder=0)
        axes[k, 0].legend(frameon=False, loc="lower left" if angle > 0 else "upper left")
        for height, words in ((1e3, "stand-off"), (0.5e3, "half of it")):
            name_line(axes[k, 1], height * STANDOFF, words)
        axes[k, 1].set(xlabel="path of the front [mm]", ylabel="clearance of the hand [mm]", ylim=(0, 24))
        axes[k, 1].legend(title="latency, time", frameon=False, loc="lower right", fontsize="small", ncols=2)
    axes[1, 0].set_title("bend of 45 degrees inwards")
    axes[0, 0].set_title("bend of 45 degrees outwards")
    save(figure, folder / "bend.svg")
    return rows


def save(figure: plt.Figure, path: Path) -> None:
    """Save a figure without dates, so that equal drawings give equal files."""
    mpl.rcParams |= {"svg.hashsalt": "tanteo", "svg.fonttype": "none"}
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def main() -> None:
    """Draw both pictures, and print the table of margins."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE
    step_response(folder)
    rows = bend(folder)
    print("| latency | gain | gain margin | phase margin | stable up to a latency of | least clearance in the bends |")
    print("| --- | --- | --- | --- | --- | --- |")
    for latency in (0.0, 0.01, 0.02, 0.03, 0.05, 0.1):
        loop = Loop.of(latency, 0.01)
        least = [c for _, x, c, _ in rows if x == latency]
        print(
            f"| {1e3 * latency:.0f} ms | {loop.gain:.2f} / s | {loop.gain_margin:.1f} | "
            f"{math.degrees(loop.phase_margin):.0f} deg | {1e3 * loop.latency_margin:.0f} ms | "
            f"{f'{min(least):.1f} mm of 20 mm' if least else ''} |"
        )
    print("\nIf the control law assumes 20 ms, the step of the height overshoots by")
    for true in (0.02, 0.05, 0.08, 0.1):
        heights = step_with(true, 0.02)[1][0]
        print(f"  {max(0.0, 20 - heights.min()) / 10:.0%} of the step with a true latency of {1e3 * true:.0f} ms")


if __name__ == "__main__":
    main()
