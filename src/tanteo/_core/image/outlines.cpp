// The outline of the part's hull is projected into the camera at every yaw, and compared direction by direction.
//
// The observed outline may include a shadow on the side away from the light, whose direction is unknown. So the directions
// of one half, any half, have to agree; in the others the part may not extend beyond the observed outline.
#include "image/outlines.hpp"

#include <algorithm>
#include <cmath>

#include "solve/maximize.hpp"

namespace tanteo {

namespace {

constexpr double PI = 3.14159265358979323846;
constexpr int K = DIRECTIONS;
constexpr int LIT = 9;              // directions at least this many steps from that of the shadow are free of it
constexpr int COARSE = 4;           // step of the directions of a shadow that are tried first
constexpr int REFINED = 3, OF_TALL = 12, ROUNDS = 5;  // number of refined yaws, of those for tall parts, and of steps of each
constexpr double TALL = 0.15;       // height over that of the camera from which the perspective depends much on the position
constexpr double LEANING = 0.05;    // change of the mean extent by an error of position, over the height of the part
constexpr double FARTHEST = 0.15;   // largest change of a yaw by refinement [rad]; the next yaw is PI / 16 away
constexpr double HIGHEST = 0.9;     // largest height of a part over that of the camera

struct Circle {  // cosines and sines of the directions
    double c[K], s[K], cc = 0, ss = 0, dark_cc = 0;
    Circle() {
        for (int k = 0; k < K; ++k) {
            c[k] = std::cos(2 * PI * k / K);
            s[k] = std::sin(2 * PI * k / K);
            if (k >= LIT && k <= K - LIT) {
                cc += c[k] * c[k];
                ss += s[k] * s[k];
            } else {
                dark_cc += std::max(c[k], 0.0) * std::max(c[k], 0.0);
            }
        }
    }
};

const Circle& circle() {
    static const Circle known;
    return known;
}

struct OnTable {  // a part on the table, about the middle of its box
    std::vector<double> x, y, scale;
    double height = 0;
    Vec3 e, f, up, middle;     // axes of the table in the part frame at zero yaw, and the point at their origin
    double place[2] = {0, 0};  // position, from below the camera, that projects half the height to the observed middle
};

OnTable on_table(const std::vector<Vec3>& points, const Vec3& down, const ObservedOutline& observed) {
    const Vec3 up = -(1 / norm(down)) * down, e = any_across(up), f = cross(up, e);
    OnTable out;
    out.e = e, out.f = f, out.up = up;
    double low = 1e300, high = -1e300, box[4] = {1e300, -1e300, 1e300, -1e300};
    for (const Vec3& p : points) {
        const double x = dot(e, p), y = dot(f, p), z = dot(up, p);
        low = std::min(low, z);
        high = std::max(high, z);
        box[0] = std::min(box[0], x);
        box[1] = std::max(box[1], x);
        box[2] = std::min(box[2], y);
        box[3] = std::max(box[3], y);
        out.x.push_back(x);
        out.y.push_back(y);
        out.scale.push_back(z);
    }
    out.height = high - low;
    out.middle = {0.5 * (box[0] + box[1]), 0.5 * (box[2] + box[3]), low};
    for (size_t v = 0; v < points.size(); ++v) {
        out.x[v] -= out.middle.x;
        out.y[v] -= out.middle.y;
        out.scale[v] = observed.eye.z / (observed.eye.z - (out.scale[v] - low));
    }
    const double nearer = 1 - 0.5 * out.height / observed.eye.z;
    for (int i = 0; i < 2; ++i) out.place[i] = nearer * (observed.middle[i] - observed.eye[i]);
    return out;
}

// Residuals of values in each direction, counted from that of the shadow, after the best position.
void placed(const double* values, int w, double* out) {
    const Circle& u = circle();
    double along = 0, across = 0;
    for (int a = 0; a < K; ++a) out[a] = values[(w + a) % K];
    for (int a = LIT; a <= K - LIT; ++a) {
        along += out[a] * u.c[a];
        across += out[a] * u.s[a];
    }
    along /= u.cc;
    across /= u.ss;
    for (int a = 0; a < K; ++a) out[a] -= along * u.c[a] + across * u.s[a];
}

// Sum of squares of the observed extent beyond the part, with the shadow at direction w and the best position; and with the
// best yaw nearby if the derivative by the yaw is given.
double cost_of(const double* beyond, const double* change, int w, double height, const ObservedOutline& observed) {
    const Circle& u = circle();
    double off[K], turned[K];
    placed(beyond, w, off);
    if (change) {
        placed(change, w, turned);
        double top = 0, bottom = 1e-12;
        for (int a = LIT; a <= K - LIT; ++a) {
            top += off[a] * turned[a];
            bottom += turned[a] * turned[a];
        }
        const double turn = std::clamp(top / bottom, -PI / K, PI / K);
        for (int a = 0; a < K; ++a) off[a] -= turn * turned[a];
    }
    double sum = 0, shadow = 0;
    for (int a = 0; a < K; ++a) {
        const bool lit = a >= LIT && a <= K - LIT;
        if (lit || off[a] < 0) sum += off[a] * off[a];
        else shadow += off[a] * std::max(u.c[a], 0.0);
    }
    const double longer = shadow / (u.dark_cc * (height + observed.sd) * observed.shadow);
    return sum / (observed.sd * observed.sd) + longer * longer;
}

struct Start {
    double cost = 1e300;
    int yaw = 0, shadow = 0;
};

// Observed extent beyond the part at each yaw, near the expected position (K, K).
std::vector<double> beyond_of(const OnTable& part, const ObservedOutline& observed) {
    const Circle& u = circle();
    const size_t n = part.x.size();
    std::vector<double> extent(n * 2 * K), moved(n * K);  // extent of each point, over two turns, and that of its position
    for (size_t v = 0; v < n; ++v)
        for (int k = 0; k < K; ++k) {
            extent[v * 2 * K + k] = extent[v * 2 * K + K + k] = part.scale[v] * (part.x[v] * u.c[k] + part.y[v] * u.s[k]);
            moved[v * K + k] = part.scale[v] * (part.place[0] * u.c[k] + part.place[1] * u.s[k]);
        }
    std::vector<double> out(K * K);
    for (int j = 0; j < K; ++j) {
        double reach[K];
        std::fill(reach, reach + K, -1e300);
        for (size_t v = 0; v < n; ++v) {
            const double *a = &extent[v * 2 * K + K - j], *b = &moved[v * K];
            for (int k = 0; k < K; ++k) reach[k] = std::max(reach[k], a[k] + b[k]);
        }
        for (int k = 0; k < K; ++k) out[j * K + k] = observed.from_eye(k) - reach[k];
    }
    return out;
}

// The most promising yaws.
std::vector<Start> starts(const OnTable& part, const ObservedOutline& observed) {
    const std::vector<double> beyond = beyond_of(part, observed);
    std::vector<Start> out;
    for (int j = 0; j < K; ++j) {
        const double *now = &beyond[j * K], *before = &beyond[(j + K - 1) % K * K], *after = &beyond[(j + 1) % K * K];
        double mean = 0, change[K];
        for (int k = 0; k < K; ++k) {
            mean += now[k] / K;
            change[k] = (before[k] - after[k]) * K / (4 * PI);  // derivative of the part's extent by the yaw
        }
        // a part with a larger mean extent has this cost at any position; for a tall part it depends on the position
        const double farther = -mean - LEANING * part.height;
        if (farther > 0 && K * farther * farther > 4 * observed.most * observed.sd * observed.sd) continue;
        Start best;
        best.yaw = j;
        for (int w = 0; w < K; w += COARSE) {
            const double cost = cost_of(now, change, w, part.height, observed);
            if (cost < best.cost) best.cost = cost, best.shadow = w;
        }
        out.push_back(best);
    }
    const size_t kept = std::min<size_t>(out.size(), part.height > TALL * observed.eye.z ? OF_TALL : REFINED);
    std::partial_sort(out.begin(), out.begin() + kept, out.end(), [](const Start& a, const Start& b) { return a.cost < b.cost; });
    out.resize(kept);
    return out;
}

struct At {  // observed extent beyond the part at a position and yaw, and its derivatives by both
    double beyond[K], J[K][3];
};

At at(const OnTable& part, const double place[2], double yaw, const ObservedOutline& observed) {
    const Circle& u = circle();
    const double c = std::cos(yaw), s = std::sin(yaw);
    At out;
    for (int k = 0; k < K; ++k) {
        double best = -1e300;
        for (size_t v = 0; v < part.x.size(); ++v) {
            const double x = c * part.x[v] - s * part.y[v], y = s * part.x[v] + c * part.y[v];
            const double reach = part.scale[v] * ((x + place[0]) * u.c[k] + (y + place[1]) * u.s[k]);
            if (reach <= best) continue;
            best = reach;
            out.J[k][0] = part.scale[v] * u.c[k];
            out.J[k][1] = part.scale[v] * u.s[k];
            out.J[k][2] = part.scale[v] * (x * u.s[k] - y * u.c[k]);
        }
        out.beyond[k] = observed.from_eye(k) - best;
    }
    return out;
}

// The normal equations of position and yaw by the directions without shadow.
NormalEquations<3> equations(const At& now, int shadow) {
    NormalEquations<3> out;
    for (int a = LIT; a <= K - LIT; ++a) {
        const int k = (shadow + a) % K;
        out.add(now.J[k], -now.beyond[k], 1);
    }
    out.information[8] += 1e-9 * (out.information[8] + 1e-12);
    return out;
}

// Pose of a part from the position of its middle relative to the camera and its yaw.
Pose pose_of(const OnTable& part, const double place[2], double yaw, const ObservedOutline& observed) {
    const double c = std::cos(yaw), s = std::sin(yaw);
    const Vec3 rows[3] = {c * part.e + (-s) * part.f, s * part.e + c * part.f, part.up};
    Pose out;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) out.R.m[3 * i + j] = rows[i][j];
    out.t = {place[0] + observed.eye.x - (c * part.middle.x - s * part.middle.y),
             place[1] + observed.eye.y - (s * part.middle.x + c * part.middle.y), -part.middle.z};
    return out;
}

OutlineFit refined(const OnTable& part, const Start& start, const ObservedOutline& observed) {
    double place[2] = {part.place[0], part.place[1]}, yaw = 2 * PI * start.yaw / K;
    const double first = yaw;
    OutlineFit best;
    int shadow = start.shadow;
    const auto compare = [&] {
        const At now = at(part, place, yaw, observed);
        double cost = 1e300;
        int nearest = shadow;
        for (int w = shadow - COARSE; w <= shadow + COARSE; ++w) {
            const double own = cost_of(now.beyond, nullptr, (w + K) % K, part.height, observed);
            if (own < cost) cost = own, nearest = (w + K) % K;
        }
        shadow = nearest;
        if (cost < best.cost) best.cost = cost, best.pose = pose_of(part, place, yaw, observed);
        return now;
    };
    At now = compare();
    gauss_newton(ROUNDS, [&](int) { return equations(now, shadow); }, [&](const double* step, const double*) {
        place[0] += step[0];
        place[1] += step[1];
        yaw = first + std::clamp(yaw + step[2] - first, -FARTHEST, FARTHEST);
        now = compare();
    });
    return best;
}

}  // namespace

double ObservedOutline::from_eye(int k) const {
    return reach[k] + (middle[0] - eye.x) * circle().c[k] + (middle[1] - eye.y) * circle().s[k];
}

OutlineFit fit_outline(const std::vector<Vec3>& points, const Vec3& down, const ObservedOutline& observed) {
    OutlineFit best;
    best.cost = observed.most;
    if (points.empty() || !(squared(down) > 0)) return best;
    double low = 1e300, high = -1e300;
    for (const Vec3& p : points) {
        low = std::min(low, dot(down, p));
        high = std::max(high, dot(down, p));
    }
    if (!((high - low) / norm(down) < HIGHEST * observed.eye.z)) return best;
    const OnTable part = on_table(points, down, observed);
    for (const Start& start : starts(part, observed)) {
        const OutlineFit found = refined(part, start, observed);
        if (found.cost < best.cost) best = found;
    }
    return best;
}

}  // namespace tanteo
