"""Uncertain frames: compose, invert, relate and fuse, over single frames and batches.

An ``UncertainFrame`` is ``T exp(e)`` with ``e ~ N(0, C)``: translation first, in the axes of the frame itself.
``compose`` adds the errors of a chain of frames. ``relate`` removes the error of a base that two frames share. ``fuse``
combines two estimates of one frame, with a chi-square test of their agreement.

    python examples/05_uncertain_frames.py
"""

import numpy as np

from tanteo.geometry import SE3, UncertainFrame, compose, fuse, relate


def sd(frame):
    """Return the standard deviations of a frame in millimetres and milliradians."""
    return np.round(1e3 * np.sqrt(frame.C.diagonal()), 2)


def frame(xi, sd_m, sd_rad):
    """Return a frame at ``exp(xi)`` with equal standard deviations in all directions."""
    return UncertainFrame(SE3.exp(np.array(xi, dtype=float)), np.diag([sd_m**2] * 3 + [sd_rad**2] * 3))


T_world_base = frame([1.0, 0.5, 0.0, 0, 0, 0.3], 2e-3, 2e-3)  # pose of the robot base: 2 mm, 2 mrad
T_base_hand = frame([0.4, 0.1, 0.3, 3.0, 0, 0], 5e-5, 1e-4)  # its repeatability
T_hand_tip = frame([0, 0, 0.15, 0, 0, 0], 3e-4, 0.0)
T_world_tip = compose(compose(T_world_base, T_base_hand), T_hand_tip)
print("tip in the world  ", sd(T_world_tip))

# two frames sensed by the same robot: their relation must not contain the error of the base
T_base_a, T_base_b = frame([0.4, 0.0, 0.1, 0, 0, 0], 1e-4, 1e-4), frame([0.5, 0.1, 0.1, 0, 0, 0.5], 1e-4, 1e-4)
a, b = compose(T_world_base, T_base_a), compose(T_world_base, T_base_b)
common = SE3.adjoint_inverse(T_base_a.T) @ T_world_base.C @ SE3.adjoint_inverse(T_base_b.T).T  # E[e_a e_b']
print("a to b, as if independent", sd(relate(a, b)))
print("a to b, with the shared base ", sd(relate(a, b, cross=common)))
print("a to b, from the base        ", sd(relate(T_base_a, T_base_b)))

# two estimates of one pose, from a camera and from touches
camera = frame([0.300, 0.100, 0.050, 0, 0, 0.70], 3e-3, 2e-2)
touches = frame([0.302, 0.099, 0.048, 0, 0, 0.69], 5e-4, 5e-3)
both = fuse(UncertainFrame(np.stack([camera.T, touches.T]), np.stack([camera.C, touches.C])))
print("camera and touches", sd(both.frame), f"chi2 {both.chi2:.1f} with {both.dof} degrees of freedom")
