"""Functions of the compiled module. Input arrays are C-contiguous; integers of another width are converted."""

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
AnyInts: TypeAlias = NDArray[np.integer[Any]]
Indices: TypeAlias = NDArray[np.int32]
Numbers: TypeAlias = NDArray[np.int64]
Flags: TypeAlias = NDArray[np.bool_]

def most_threads() -> int: ...
def version() -> str: ...

class Shape:
    @property
    def area(self) -> float: ...
    @property
    def diagonal(self) -> float: ...
    @property
    def flats(self) -> int: ...
    @property
    def centre(self) -> FloatArray: ...
    @property
    def samples(self) -> FloatArray: ...
    @property
    def normals(self) -> FloatArray: ...
    def bytes(self) -> bytes: ...

class PoseTerm: ...

class Problem:
    @property
    def size(self) -> int: ...
    def add(self, term: PoseTerm) -> None: ...

def python_term(
    name: str,
    log_density: Callable[[FloatArray], FloatArray],
    gradient: Callable[[FloatArray], FloatArray] | None,
    shift: float,
    turn: float,
    outlier_rate: float,
) -> PoseTerm: ...
def make_shape(
    vertices: FloatArray,
    triangles: AnyInts,
    faces: AnyInts,
    profile_rows: AnyInts,
    profiles: FloatArray,
    edges: FloatArray,
    corners: FloatArray,
    axes: FloatArray,
    hull: FloatArray,
    centre: FloatArray,
    samples: FloatArray,
    sample_normals: FloatArray,
    cells: int,
    areas: FloatArray | None = None,
) -> Shape: ...
def open_shape(buffer: NDArray[np.uint8]) -> Shape: ...

class FactorList:
    def __len__(self) -> int: ...

def make_factors(kind: str, columns: dict[str, FloatArray]) -> FactorList: ...
def make_term(kind: str, arrays: dict[str, FloatArray], first: int) -> PoseTerm: ...
def landmark_codes() -> dict[str, int]: ...
def make_problem(
    factors: Sequence[tuple[FactorList, AnyInts]],
    furniture: FloatArray,
    groups: AnyInts,
    log_elsewhere: FloatArray,
    shared_jacobian: FloatArray,
    direction_jacobian: FloatArray,
    scale_sd: float,
    rates: FloatArray,
    rate_weights: FloatArray,
    mean_rate: float,
    rays: FloatArray,
    ray_shifts: FloatArray,
    ray_turns: FloatArray,
    prior_means: FloatArray,
    prior_roots: FloatArray,
    prior_log_weights: FloatArray,
    table: FloatArray,
    region: FloatArray,
    group_regions: FloatArray,
    one_sided: AnyInts,
) -> Problem: ...
def lane_widths() -> list[int]: ...
def set_lane_width(width: int) -> None: ...
def exponentials(numbers: FloatArray) -> FloatArray: ...
def edge_integrals(edges: FloatArray) -> FloatArray: ...
def log_densities(shape: Shape, problem: Problem, poses: FloatArray, shared: FloatArray) -> FloatArray: ...
def slopes(
    shape: Shape,
    problem: Problem,
    poses: FloatArray,
    shared: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]: ...
def details(
    shape: Shape,
    problem: Problem,
    poses: FloatArray,
    shared: FloatArray,
) -> tuple[FloatArray, Indices, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]: ...
def propose(
    shape: Shape,
    problem: Problem,
    rows: AnyInts,
    pairs: AnyInts,
    per_pair: int,
    spins: int,
    tolerance: float,
    blur: float,
    tilt: float,
    keep: int,
    seeds: Numbers,
) -> tuple[FloatArray, Indices]: ...
def assigned_poses(
    shape: Shape,
    problem: Problem,
    rows: AnyInts,
    mean: FloatArray,
    information: FloatArray,
    gate: float,
    cost: float,
    gap: float,
    noise: float,
    outliers: int,
    nodes: int,
    keep: int,
) -> tuple[FloatArray, FloatArray, int, bool]: ...
def placements(
    shape: Shape, points: FloatArray, offsets: FloatArray, sds: FloatArray, seed: int
) -> tuple[FloatArray, FloatArray, Indices]: ...
def scores(
    shape: Shape,
    problem: Problem,
    rows: AnyInts,
    poses: FloatArray,
    blur: float,
    tilt: float,
) -> FloatArray: ...
def refine_poses(
    shape: Shape,
    problem: Problem,
    rows: AnyInts,
    scales: FloatArray,
    poses: FloatArray,
    offset_sd: float = 0.0,
    with_distances: bool = False,
    known: float = 1e300,
) -> tuple[FloatArray, FloatArray, Indices, FloatArray, FloatArray]: ...
def maximize(
    shape: Shape,
    problem: Problem,
    poses: FloatArray,
    shared: FloatArray,
    blurs: FloatArray,
    steps: int,
    enough: float,
    margin: float,
    near: float = 0.0,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, Indices, Indices]: ...
def marginals(
    shape: Shape,
    problem: Problem,
    poses: FloatArray,
    shared: FloatArray,
) -> tuple[FloatArray, FloatArray]: ...
def place(poses: FloatArray, offsets: FloatArray, centre: FloatArray) -> FloatArray: ...
def offsets(base: FloatArray, poses: FloatArray, centre: FloatArray) -> FloatArray: ...
def mixture(
    poses: FloatArray,
    bases: FloatArray,
    bends: FloatArray,
    owners: AnyInts,
    m: int,
    means: FloatArray,
    inverses: FloatArray,
    log_weights: FloatArray,
    freedom: float,
    centre: FloatArray,
) -> tuple[FloatArray, FloatArray]: ...
def distinct(
    poses: FloatArray,
    informations: FloatArray,
    limit: float,
    most: int,
    centre: FloatArray,
    symmetries: FloatArray | None = None,
) -> tuple[Indices, Indices]: ...
def coarse(
    field: NDArray[np.int8],
    field_start: NDArray[np.int64],
    grid: NDArray[np.float32],
    spacings: FloatArray,
    centres: FloatArray,
    boxes: FloatArray,
    levels: float,
    rows: AnyInts,
    kinds: AnyInts,
    best: float,
    gap: float,
    points: FloatArray,
    normals: FloatArray,
    sds: FloatArray,
    tilts: FloatArray,
    radii: FloatArray,
    most: float,
    stepped: int,
    keep: int,
) -> tuple[FloatArray, FloatArray, FloatArray]: ...
def fit_outlines(
    hull: NDArray[np.float32],
    hull_start: NDArray[np.int64],
    downs: NDArray[np.float32],
    of: AnyInts,
    reach: FloatArray,
    middle: FloatArray,
    eye: FloatArray,
    sd: float,
    shadow: float,
    most: float,
) -> tuple[FloatArray, FloatArray]: ...
def on_planes(
    planes: NDArray[np.float32],
    starts: NDArray[np.int64],
    rounds: NDArray[np.float32],
    rounds_start: NDArray[np.int64],
    unseen: FloatArray,
    rows: AnyInts,
    sensed: FloatArray,
    triples: AnyInts,
    walls: AnyInts,
    limit: float,
    gap: float,
    keep: int,
) -> tuple[FloatArray, FloatArray]: ...
def axes_lack(
    axes: NDArray[np.float32], starts: NDArray[np.int64], rows: AnyInts, centres: FloatArray
) -> FloatArray: ...
def on_axes(
    axes: NDArray[np.float32],
    axes_start: NDArray[np.int64],
    planes: NDArray[np.float32],
    planes_start: NDArray[np.int64],
    rounds: NDArray[np.float32],
    rounds_start: NDArray[np.int64],
    unseen: FloatArray,
    rows: AnyInts,
    centres: FloatArray,
    sensed: FloatArray,
    seeds: AnyInts,
    poses_before: FloatArray,
    poses_start: AnyInts,
    limit: float,
    gap: float,
    keep: int,
) -> tuple[FloatArray, FloatArray, Indices]: ...
def angles_between(normals: FloatArray, left: Numbers, right: Numbers) -> FloatArray: ...
def longest_sides(vertices: FloatArray, triangles: Numbers) -> FloatArray: ...
def components(count: int, first: Numbers, second: Numbers) -> Numbers: ...
def edge_table(triangles: Numbers, vertices: int) -> tuple[Numbers, Numbers, Numbers, Numbers, Numbers]: ...
def key_sets(keys: Numbers) -> tuple[Numbers, Numbers]: ...
def middles_and_volumes(
    vertices: FloatArray, triangles: Numbers, origin: FloatArray
) -> tuple[FloatArray, FloatArray]: ...
def near_pairs(points: FloatArray, distance: float) -> Numbers: ...
def simplify(
    vertices: FloatArray,
    triangles: AnyInts,
    faces: AnyInts,
    tolerance: float,
    tilt: float,
) -> tuple[Indices, Indices]: ...
def triangle_geometry(vertices: FloatArray, triangles: Numbers) -> tuple[FloatArray, FloatArray]: ...
def weld(corners: NDArray[np.float32] | FloatArray) -> tuple[FloatArray, Numbers]: ...
def closest_points(shape: Shape, points: FloatArray) -> tuple[FloatArray, FloatArray, Indices]: ...
def first_hits(shape: Shape, origins: FloatArray, directions: FloatArray) -> tuple[FloatArray, Indices]: ...
def beams(
    shape: Shape,
    poses: FloatArray,
    origins: FloatArray,
    directions: FloatArray,
) -> tuple[FloatArray, FloatArray, Indices, FloatArray]: ...
def fit_rounds(
    kind: int,
    surface: int,
    rows: AnyInts,
    points: FloatArray,
    covs: FloatArray,
    normals: FloatArray,
    normal_sds: FloatArray,
    outward: FloatArray,
    side: int,
    shared_jacobian: FloatArray,
    size: float,
    size_sd: float,
    frame: FloatArray,
    frame_information: FloatArray,
    frame_jacobian: FloatArray,
    limit: float,
) -> tuple[
    FloatArray,
    FloatArray,
    FloatArray,
    FloatArray,
    FloatArray,
    FloatArray,
    FloatArray,
    FloatArray,
    FloatArray,
    Indices,
    FloatArray,
]: ...
def round_distances(surface: int, points: FloatArray, size: float) -> tuple[FloatArray, FloatArray, FloatArray]: ...
def circle_centre(points: FloatArray, rotation: FloatArray) -> FloatArray: ...
def spreads(derivatives: FloatArray, covariances: FloatArray) -> FloatArray: ...
def group_information(weights: FloatArray, means: FloatArray, variances: FloatArray, groups: AnyInts) -> FloatArray: ...

class EdgeFrame:
    @property
    def size(self) -> int: ...

def make_edge_frame(
    points: FloatArray,
    tangents: FloatArray,
    normals: FloatArray,
    lengths: FloatArray,
    sharp: Flags,
    corners: FloatArray,
    diagonal: float,
    middle: FloatArray,
    slack: float,
    view_step: float,
) -> EdgeFrame: ...
def visible_edges(frame: EdgeFrame, poses: FloatArray, hidden: bool) -> tuple[Flags, Flags]: ...
def match_edges(
    frame: EdgeFrame,
    camera: FloatArray,
    nearest: AnyInts,
    pixels: FloatArray,
    sds: FloatArray,
    poses: FloatArray,
    shown: Flags,
    reach: float,
) -> tuple[FloatArray, Indices, Flags]: ...
def refine_edges(
    frame: EdgeFrame,
    camera: FloatArray,
    nearest: AnyInts,
    pixels: FloatArray,
    sds: FloatArray,
    poses: FloatArray,
    starts: FloatArray,
    priors: FloatArray,
    reaches: FloatArray,
    visibility: Flags,
    bias: float,
    correlation: float,
) -> FloatArray: ...

class EdgeImage:
    @property
    def states(self) -> int: ...

class EdgePart: ...
class ImageEdges(PoseTerm): ...
class StablePoses(PoseTerm): ...
class NormalPoses(PoseTerm): ...
class Alternatives(PoseTerm): ...

def make_edge_image(
    camera: FloatArray,
    T_world_camera: FloatArray,
    camera_root: FloatArray,
    mount_root: FloatArray,
    shift_sd: float,
    nearest: AnyInts,
    pixels: FloatArray,
    sds: FloatArray,
    commons: FloatArray,
    widths: FloatArray,
    normals: FloatArray,
    drifts: FloatArray,
    responses: FloatArray,
    blur: float,
    chance: NDArray[np.float32],
) -> EdgeImage: ...
def make_edge_part(
    frame: EdgeFrame,
    groups: AnyInts,
    bends: FloatArray,
    marks: FloatArray,
) -> EdgePart: ...
def image_edges(
    part: EdgePart,
    image: EdgeImage,
    rules: FloatArray,
    level_poses: FloatArray,
    levels: FloatArray,
    reach: float,
    first: int,
    common: int,
) -> ImageEdges: ...
def image_sums(term: ImageEdges, poses: FloatArray, shared: FloatArray) -> FloatArray: ...
def stable_poses(
    ups: FloatArray,
    heights: FloatArray,
    log_weights: FloatArray,
    centroid: FloatArray,
    freedom: int,
    axis: FloatArray,
    T_world_table: FloatArray,
    height_sd: float,
    tilt_sd: float,
    area: float,
) -> StablePoses: ...
def normal_poses(means: FloatArray, roots: FloatArray, log_weights: FloatArray) -> NormalPoses: ...
def alternatives(groups: Sequence[Sequence[PoseTerm]], log_weights: FloatArray) -> Alternatives: ...
def term_slopes(
    term: PoseTerm, poses: FloatArray, shared: FloatArray, centre: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]: ...
def slide_edges(
    frame: EdgeFrame,
    camera: FloatArray,
    yaws: FloatArray,
    centre: FloatArray,
    distances: NDArray[np.float32],
    places: FloatArray,
    cell: float,
    margin: int,
    samples: int,
    apart: float,
    keep: int,
) -> tuple[Indices, Indices, FloatArray]: ...
def nearest_pixels(pixels: FloatArray, places: FloatArray, reach: float) -> Indices: ...
def far_apart(points: FloatArray, order: AnyInts, limit: float) -> Indices: ...
