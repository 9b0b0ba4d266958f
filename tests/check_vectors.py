"""Check a file of test vectors (schema of ``math.md`` section 14) against the package's public functions.

    python tests/check_vectors.py FILE

Prints the count by function and every failure; exits 0 if all pass, 1 if some fail, 2 on misuse.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tanteo import features, fitting, planning
from tanteo.features import Feature
from tanteo.features.constraints import published
from tanteo.features.kinds import EDGE, PLANE, feature_kind
from tanteo.features.reframing import reframe
from tanteo.fitting.localization import RELATIONS, Block, assemble, fuse_features, gauss_newton, linearize
from tanteo.geometry import SE3, relate_arrays
from tanteo.geometry.location import compose_locations, invert_location, loc_to_matrix, matrix_to_loc, relate_locations
from tanteo.geometry.location_jacobians import (
    J1_at_zero,
    J2_at_zero,
    J2_at_zero_inverse,
    J_ominus,
    compose_jacobians,
    differential_jacobian,
    differential_jacobian_inverse,
    location_covariance,
)
from tanteo.geometry.propagation import compose_arrays, compose_fourth_order
from tanteo.sensors.noise import range_variance, sensed_point, sensor_error_cov

Inputs = dict[str, Any]
Outputs = dict[str, Any]


SAME_RELATION = {"point_on_plane": "vertex_on_plane", "axis_axis": "edge_edge"}
"""Names that the vectors have for one row of the table of relations."""


def given(i: Inputs, a: str, b: str, cross: str = "C12") -> tuple[Any, ...]:
    """``T1, C1, T2, C2, C12`` of a pair whose keys end in ``a`` and ``b``."""
    return (loc_to_matrix(i[f"x{a}"]), i[f"C{a}"], loc_to_matrix(i[f"x{b}"]), i[f"C{b}"], i.get(cross))


def pair(i: Inputs) -> tuple[Any, ...]:
    return given(i, "1", "2")


def compose(i: Inputs) -> Outputs:
    return {"x": compose_locations(i["x1"], i["x2"]), "T": loc_to_matrix(i["x1"]) @ loc_to_matrix(i["x2"])}


def relative_cov(i: Inputs) -> Outputs:
    T12, C = relate_arrays(*pair(i))
    x12 = matrix_to_loc(T12)
    return {"x12": x12, "cov_e": C, "cov_eps": location_covariance(x12, C)}


def compose_J(i: Inputs) -> Outputs:
    J1, J2 = compose_jacobians(i["x1"], i["x2"])
    return {"J1": J1, "J2": J2}


def error_cov(i: Inputs) -> Outputs:
    cov = sensor_error_cov(loc_to_matrix(i["xRS"]), loc_to_matrix(i["xSF"]), i["Cr"], i["Cd"])
    return {"xRF": compose_locations(i["xRS"], i["xSF"]), "cov": cov}


def coplanarity(i: Inputs) -> Outputs:
    both = given(i, "S", "E", "CSE")
    found = features.coplanarity(*both)
    (_, theta), cov = features.height_and_pitch(found)
    return {
        "p_z": found.value[0],
        "theta": theta,
        "n_z": found.value[1],
        "cov_pz_theta": cov,
        "cov_pz_nz": found.covariance,
        "chi2_2dof": features.chi2_statistic(found.value, found.covariance),
        "printed_cov_pz_theta": published.coplanarity(*both)[1],
    }


def edge_intersection(i: Inputs) -> Outputs:
    pz, py = published.abscissa_z(*pair(i)), published.abscissa_y(*pair(i))
    foot, gap = features.intersect(*pair(i)), features.gap_edges(*pair(i))
    return {
        "pz": pz.value,
        "var_pz": pz.variance,
        "py": py.value,
        "var_py": py.variance,
        "closest": foot.value,
        "var_closest": foot.variance,
        "gap": gap.value,
        "var_gap": gap.variance,
    }


def edge_length(i: Inputs) -> Outputs:
    A, E, B = (loc_to_matrix(i[x]) for x in ("xA", "xE", "xB"))
    blocks = [i["C18"][k : k + 6, k : k + 6] for k in (0, 6, 12)]
    alone = np.zeros((18, 18))
    for k, block in enumerate(blocks):
        alone[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = block
    each = (A, blocks[0], E, blocks[1], B, blocks[2])
    printed, shared = published.edge_length(*each), published.edge_length_shared(*each)
    closest, full = features.edge_length(A, E, B, alone), features.edge_length(A, E, B, i["C18"])
    return {
        "l_pz": printed.value,
        "printed_var": printed.variance,
        "var_pz_shared": shared.variance,
        "l_closest": closest.value,
        "var_closest_shared": closest.variance,
        "var_closest_full": full.variance,
    }


def point_distance(i: Inputs) -> Outputs:
    found = features.constraints.point.point_distance(i["p1"], i["p2"], i["S"])
    return {"l": found.value, "var": found.variance, "bias2": found.bias}


def angle(function: Callable[..., Any]) -> Callable[[Inputs], Outputs]:
    def check(i: Inputs) -> Outputs:
        found = function(*pair(i))
        return {"alpha": found.value, "var": found.variance}

    return check


def parallel(function: Callable[..., Any], printed: Callable[..., Any]) -> Callable[[Inputs], Outputs]:
    def check(i: Inputs) -> Outputs:
        found, (cosine, _) = function(*pair(i)), printed(*pair(i))
        return {
            "cos": cosine.value,
            "printed_var_cos": cosine.variance,
            "sign": found.sign,
            "v": found.tilt,
            "cov_v_d": found.joint.covariance,
            "T2_2dof": features.chi2_statistic(found.tilt, found.tilt_covariance),
            "d": found.joint.value[2],
            "var_d": found.joint.covariance[2, 2],
            "d_given_parallel": found.distance,
            "var_d_given_parallel": found.variance,
        }

    return check


def gate(i: Inputs) -> Outputs:
    found = features.gate(i["c_hat"], i["var"], i["c_model"], i["alpha"])
    return {"D_M": found.D_M, "D2": found.D2, "accept": found.accept}


def cov_compose(i: Inputs) -> Outputs:
    each = (np.eye(4), i["C1"], loc_to_matrix(i["x2"]), i["C2"])
    return {"cov_2nd": compose_arrays(*each)[1], "cov_4th": compose_fourth_order(*each)[1]}


def reframed(i: Inputs) -> Outputs:
    kind = feature_kind(i["kind"])
    T, P = reframe(kind, loc_to_matrix(i["x"]), kind.B @ i["C"] @ kind.B.T, loc_to_matrix(i["S"]))
    return {"T": T, "P": P}


def block(p: Inputs) -> Block:
    relation = RELATIONS[SAME_RELATION.get(p["kind"], p["kind"])]
    k, size = relation.sensed.size, relation.model.size
    return Block(
        relation,
        loc_to_matrix(p["xWF"])[None],
        np.asarray(p["P"], dtype=float)[None],
        loc_to_matrix(p["xOM"])[None],
        np.zeros((1, size, size)),
        np.zeros((1, k, 0)),
        np.array([p.get("r", 0.0)]),
        np.array([True]),
    )


def pairing(i: Inputs) -> Outputs:
    at = linearize(block(i), loc_to_matrix(i["xWO"]), np.zeros(0))
    return {"f": at.f[0], "H": at.H[0], "S": at.S[0]}


def pose_estimate(i: Inputs) -> Outputs:
    blocks = [block(p) for p in i["pairs"]]
    T0 = loc_to_matrix(i["xWO0"])
    at = assemble(blocks, T0, np.zeros(0))
    end = gauss_newton(blocks, T0, 0)
    log_prior = -np.log(8 * np.pi**2 * i["prior_volume"])
    return {
        "Lambda0": at.information,
        "grad0": at.gradient,
        "chi2_0": at.chi2,
        "T": end.T_world_part,
        "Lambda": end.information,
        "chi2": end.chi2,
        "dof": end.equations - np.linalg.matrix_rank(end.information),
        "log_evidence": features.constraints.joint.laplace_log_evidence(
            end.chi2, end.log_det, end.equations, end.information, log_prior
        ),
    }


def fuse(i: Inputs) -> Outputs:
    T, P, chi2, _ = fuse_features(
        feature_kind(i["kind"]), loc_to_matrix(i["x1"]), i["P1"], loc_to_matrix(i["x2"]), i["P2"]
    )
    return {"T": T, "P": P, "chi2": chi2}


def range_prediction(i: Inputs) -> Outputs:
    found = planning.predictions.predict_range(
        loc_to_matrix(i["xWO"]), i["P"], loc_to_matrix(i["xOM"]), i["origin"], i["direction"], i["var_d"]
    )
    return {"mean": found.mean, "var": found.variance, "grad": found.gradient}


def point(i: Inputs) -> Outputs:
    q, C = sensed_point(
        loc_to_matrix(i["xWR"]),
        loc_to_matrix(i["xRS"]),
        i["d"],
        cov_robot=i["Cr"],
        cov_sensor=i["Cs"],
        var_range=i["var_d"],
        cone_half_angle=i["gamma"],
    )
    return {"q": q, "C": C}


def plane_ml(i: Inputs) -> Outputs:
    plane, report = fitting.fit_plane(i["points"], i["covs"], outward=i["outward"])
    T = plane.T_world_feature
    return {
        "normal": T[:3, 2],
        "offset": T[:3, 2] @ T[:3, 3],
        "chi2": report.chi2,
        "disp_cov": fitting.spread.plane_displacement_covariance(T, plane.P, i["test_points"]),
    }


def plane_two_directions(i: Inputs) -> Outputs:
    q = [i[k] for k in ("q1", "q2", "q3", "q4")]
    plane = fitting.plane_from_two_directions(*q, i["C12"], outward=i["outward"])
    T = plane.T_world_feature
    return {"normal": T[:3, 2], "cov_normal_and_disp": fitting.spread.plane_normal_covariance(T, plane.P)}


def edge_two_points(i: Inputs) -> Outputs:
    edge = fitting.edge_from_two_points(i["q1"], i["q2"], i["C6"])
    T = edge.T_world_feature
    return {"direction": T[:3, 0], "cov": fitting.spread.edge_direction_covariance(T, edge.P)}


def edge_from_planes(i: Inputs) -> Outputs:
    a, b = (Feature(PLANE, loc_to_matrix(i[f"x{k}"]), i[f"P{k}"]) for k in "12")
    edge = fitting.edge_from_planes(a, b, i["near"])
    T = edge.T_world_feature
    return {"direction": T[:3, 0], "point": T[:3, 3], "cov": fitting.spread.edge_direction_covariance(T, edge.P)}


def vertex_from_lines(i: Inputs) -> Outputs:
    edges = [Feature(EDGE, loc_to_matrix(x), P) for x, P in zip(i["x"], i["P"], strict=True)]
    vertex, report = fitting.intersect_edges(edges)
    return {"X": vertex.T_world_feature[:3, 3], "cov": vertex.P, "chi2": report.chi2}


def joint_mahalanobis(i: Inputs) -> Outputs:
    found = features.joint_test(i["f"], i["H"], i["S"])
    return {"D2": found.D2, "dof": found.dof, "xi": found.xi, "pvalue": found.p_value}


def jcbb_increment(i: Inputs) -> Outputs:
    first = features.joint_test(i["f1"], i["H1"], i["S1"])
    both = features.constraints.joint.joint_update(first, i["f2"], i["H2"], i["S2"])
    return {"D2_first": first.D2, "D2_both": both.D2, "xi_both": both.xi, "Lambda_both": both.information}


def divergences(i: Inputs) -> Outputs:
    each = (i["m1"], i["S1"], i["m2"], i["S2"])
    return {"KL": planning.measures.kl_divergence(*each), "bhattacharyya": planning.measures.bhattacharyya(*each)}


def active_1d(i: Inputs) -> Outputs:
    found = planning.measures.gate_discrimination(i["w"], i["mu"], i["var"], i["alpha"])
    names = ("accept", "expected_remaining", "mutual_information", "mi_lower", "mi_upper", "error_bound")
    return {name: getattr(found, name) for name in names}


def accept_prob(i: Inputs) -> Outputs:
    found = planning.measures.accept_probability(i["delta"], i["S"], i["alpha"])
    return {"lam": found.noncentrality, "p": found.p}


FUNCTIONS: dict[str, Callable[[Inputs], Outputs]] = {
    "loc_to_matrix": lambda i: {"T": loc_to_matrix(i["x"])},
    "matrix_to_loc": lambda i: {"x": matrix_to_loc(i["T"])},
    "compose": compose,
    "inverse": lambda i: {"x": invert_location(i["x"])},
    "relative": lambda i: {"x": relate_locations(i["x1"], i["x2"])},
    "diff_jacobian": lambda i: {"FJW": differential_jacobian_inverse(i["x"]), "WJF": differential_jacobian(i["x"])},
    "compose_jacobians": compose_J,
    "J2_at_zero": lambda i: {
        "J2": J2_at_zero(i["x"]),
        "J2inv": J2_at_zero_inverse(i["x"]),
        "J1left": J1_at_zero(i["x"]),
    },
    "inverse_jacobian": lambda i: {"J": J_ominus(i["x"])},
    "relative_cov": relative_cov,
    "sensor_error_cov": error_cov,
    "coplanarity": coplanarity,
    "edge_intersection": edge_intersection,
    "edge_length": edge_length,
    "point_distance": point_distance,
    "angle_edges": angle(features.angle_edges),
    "angle_planes": angle(features.angle_planes),
    "parallel_edges": parallel(features.parallel_edges, published.parallel_edges),
    "parallel_planes": parallel(features.parallel_planes, published.parallel_planes),
    "chi2_isf": lambda i: {"x": features.chi2_limit(i["alpha"], i["dof"])},
    "gate": gate,
    "se3_exp": lambda i: {
        "T": SE3.exp(i["xi"]),
        "Ad": SE3.adjoint(SE3.exp(i["xi"])),
        "Jr": SE3.right_jacobian(i["xi"]),
    },
    "cov_compose": cov_compose,
    "reframe": reframed,
    "pairing": pairing,
    "pose_estimate": pose_estimate,
    "fuse": fuse,
    "range_prediction": range_prediction,
    "sensed_point": point,
    "range_variance": lambda i: {"var": range_variance(**i)},
    "plane_ml": plane_ml,
    "plane_two_directions": plane_two_directions,
    "edge_two_points": edge_two_points,
    "edge_from_planes": edge_from_planes,
    "vertex_from_lines": vertex_from_lines,
    "joint_mahalanobis": joint_mahalanobis,
    "jcbb_increment": jcbb_increment,
    "divergences": divergences,
    "active_1d": active_1d,
    "accept_prob": accept_prob,
}
LOCATIONS = {("matrix_to_loc", "x"), ("compose", "x"), ("inverse", "x"), ("relative", "x")} | {
    ("relative_cov", "x12"),
    ("sensor_error_cov", "xRF"),
}


def as_arrays(inputs: Inputs) -> Inputs:
    """Return lists of numbers as arrays; lists of records and ragged lists stay."""
    out = dict(inputs)
    for key, value in inputs.items():
        if isinstance(value, list) and value and not isinstance(value[0], dict):
            out[key] = np.array(value, dtype=float)
    return out


def error(fn: str, key: str, got: Any, wanted: Any) -> float:
    """``max |y - x| / max |x|``; the angles of location vectors modulo a turn."""
    y, x = np.asarray(got, dtype=float), np.asarray(wanted, dtype=float)
    if y.shape != x.shape and y.size == x.size:
        y = y.reshape(x.shape)
    if y.shape != x.shape:
        return float("inf")
    gap = np.abs(y - x)
    if (fn, key) in LOCATIONS:
        gap[..., 3:] = np.abs(np.mod(y[..., 3:] - x[..., 3:] + np.pi, 2 * np.pi) - np.pi)
    scale = np.abs(x).max(initial=0.0)
    worst = gap.max(initial=0.0)
    return float(worst / scale if scale > 0 else worst) if np.isfinite(worst) else float("inf")


def check(vector: dict[str, Any]) -> list[str]:
    """Return the errors of our answer to one vector, one line for each output; empty if all are right."""
    fn = vector["fn"]
    if fn not in FUNCTIONS:
        return [f"{vector['id']}: unknown function {fn!r}"]
    inputs = as_arrays(vector["inputs"])
    try:
        got = FUNCTIONS[fn](inputs)
    except Exception as exception:  # noqa: BLE001  one vector that cannot be computed must not hide the others
        return [f"{vector['id']}: {type(exception).__name__}: {exception}"]
    if fn == "se3_exp":
        back = error(fn, "xi", SE3.log(SE3.exp(inputs["xi"])), inputs["xi"])
        if back > vector["rtol"] and np.linalg.norm(inputs["xi"][3:]) < np.pi:
            return [f"{vector['id']}: log(exp(xi)) off by {back:.1e}"]
    wrong = []
    for key, wanted in vector["expected"].items():
        if key not in got:
            wrong.append(f"{vector['id']}: no output {key!r}")
            continue
        off = error(fn, key, got[key], wanted)
        if not off <= vector["rtol"]:
            wrong.append(f"{vector['id']}: {key} off by {off:.1e}, allowed {vector['rtol']:.0e}")
    return wrong


def main(arguments: list[str]) -> int:
    """Check one file; returns the exit code."""
    if len(arguments) != 1 or not Path(arguments[0]).is_file():
        print("usage: python tests/check_vectors.py FILE   (a JSON file with a list 'vectors')", file=sys.stderr)
        return 2
    vectors = json.loads(Path(arguments[0]).read_text())["vectors"]
    total, passed, lines = Counter(), Counter(), []
    for vector in vectors:
        wrong = check(vector)
        total[vector["fn"]] += 1
        passed[vector["fn"]] += not wrong
        lines += wrong
    for fn in total:
        print(f"{fn:22} {passed[fn]:4}/{total[fn]}")
    print(f"{'all':22} {sum(passed.values()):4}/{sum(total.values())}")
    print(*lines, sep="\n", end="\n" if lines else "")
    return 0 if not lines else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
