// The outline of the part's hull is computed at every yaw where the camera sees it, and compared direction by direction.
//
// A shadow belongs to what was seen: it lies on the side away from the light, which nobody knows. So half of the
// directions, any half, have to agree, and in the others the part may not reach farther than what was seen.
#include "image/outlines.hpp"

#include <algorithm>
#include <cmath>

#include "solve/maximize.hpp"

namespace tanteo {

namespace {

constexpr double PI = 3.14159265358979323846;
constexpr int K = AROUND;
constexpr int LIT = 9;              // directions at least this many steps from that of the shadow have none of it
constexpr int COARSE = 4;           // every so many directions of a shadow are tried first
constexpr int REFINED = 3, OF_TALL = 12, ROUNDS = 5;  // yaws that are refined, and steps of each
constexpr double TALL = 0.15;       // share of the camera's height from which it matters much where a part is
constexpr double LEANING = 0.05;    // how much farther around a part may seem to go where it is not, in its heights
constexpr double FARTHEST = 0.15;   // a yaw is refined by no more than this: the next one is PI / 16 away
constexpr double HIGHEST = 0.9;     // share of the camera's height that a part may have

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

struct Lying {  // a part on the table, about the middle of its box
    std::vector<double> x, y, scale;
    double height = 0;
    Vec3 e, f, up, middle;     // axes of the table in the part's frame before any yaw, and what is at their origin
    double place[2] = {0, 0};  // where that has to be for half its height to be seen in the middle, from the eye
};

Lying lying(const std::vector<Vec3>& points, const Vec3& down, const OutlineSeen& seen) {
    const Vec3 up = -(1 / norm(down)) * down, e = any_across(up), f = cross(up, e);
    Lying out;
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
        out.scale[v] = seen.eye.z / (seen.eye.z - (out.scale[v] - low));
    }
    const double nearer = 1 - 0.5 * out.height / seen.eye.z;
    for (int i = 0; i < 2; ++i) out.place[i] = nearer * (seen.middle[i] - seen.eye[i]);
    return out;
}

// What remains of values in each direction, from that of the shadow on, when the place that fits best is taken off.
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

// Squares of what is seen beyond the part, with the shadow at direction w and the place that fits best; and with the
// best yaw nearby, where it is known how that changes what is seen.
double cost_of(const double* beyond, const double* change, int w, double height, const OutlineSeen& seen) {
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
    const double longer = shadow / (u.dark_cc * (height + seen.sd) * seen.shadow);
    return sum / (seen.sd * seen.sd) + longer * longer;
}

struct Start {
    double cost = 1e300;
    int yaw = 0, shadow = 0;
};

// What is seen beyond the part at each yaw, about where it has to be ``(K, K)``.
std::vector<double> beyond_of(const Lying& part, const OutlineSeen& seen) {
    const Circle& u = circle();
    const size_t n = part.x.size();
    std::vector<double> around(n * 2 * K), moved(n * K);  // of each point, twice around, and what its place adds
    for (size_t v = 0; v < n; ++v)
        for (int k = 0; k < K; ++k) {
            around[v * 2 * K + k] = around[v * 2 * K + K + k] = part.scale[v] * (part.x[v] * u.c[k] + part.y[v] * u.s[k]);
            moved[v * K + k] = part.scale[v] * (part.place[0] * u.c[k] + part.place[1] * u.s[k]);
        }
    std::vector<double> out(K * K);
    for (int j = 0; j < K; ++j) {
        double reach[K];
        std::fill(reach, reach + K, -1e300);
        for (size_t v = 0; v < n; ++v) {
            const double *a = &around[v * 2 * K + K - j], *b = &moved[v * K];
            for (int k = 0; k < K; ++k) reach[k] = std::max(reach[k], a[k] + b[k]);
        }
        for (int k = 0; k < K; ++k) out[j * K + k] = seen.from_eye(k) - reach[k];
    }
    return out;
}

// The most promising yaws.
std::vector<Start> starts(const Lying& part, const OutlineSeen& seen) {
    const std::vector<double> beyond = beyond_of(part, seen);
    std::vector<Start> out;
    for (int j = 0; j < K; ++j) {
        const double *now = &beyond[j * K], *before = &beyond[(j + K - 1) % K * K], *after = &beyond[(j + 1) % K * K];
        double mean = 0, change[K];
        for (int k = 0; k < K; ++k) {
            mean += now[k] / K;
            change[k] = (before[k] - after[k]) * K / (4 * PI);  // of the part's reach
        }
        // wherever it is, a part that goes farther around costs as much; where it is tall, that depends on where it is
        const double farther = -mean - LEANING * part.height;
        if (farther > 0 && K * farther * farther > 4 * seen.most * seen.sd * seen.sd) continue;
        Start best;
        best.yaw = j;
        for (int w = 0; w < K; w += COARSE) {
            const double cost = cost_of(now, change, w, part.height, seen);
            if (cost < best.cost) best.cost = cost, best.shadow = w;
        }
        out.push_back(best);
    }
    const size_t kept = std::min<size_t>(out.size(), part.height > TALL * seen.eye.z ? OF_TALL : REFINED);
    std::partial_sort(out.begin(), out.begin() + kept, out.end(), [](const Start& a, const Start& b) { return a.cost < b.cost; });
    out.resize(kept);
    return out;
}

struct At {  // what is seen beyond the part at a place and yaw, and how that changes with both
    double beyond[K], J[K][3];
};

At at(const Lying& part, const double place[2], double yaw, const OutlineSeen& seen) {
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
        out.beyond[k] = seen.from_eye(k) - best;
    }
    return out;
}

// The normal equations of place and yaw by the directions without shadow.
NormalEquations<3> equations(const At& now, int shadow) {
    NormalEquations<3> out;
    for (int a = LIT; a <= K - LIT; ++a) {
        const int k = (shadow + a) % K;
        out.add(now.J[k], -now.beyond[k], 1);
    }
    out.information[8] += 1e-9 * (out.information[8] + 1e-12);
    return out;
}

// Where a part is, by the place of its middle from the eye and its yaw.
Pose pose_of(const Lying& part, const double place[2], double yaw, const OutlineSeen& seen) {
    const double c = std::cos(yaw), s = std::sin(yaw);
    const Vec3 rows[3] = {c * part.e + (-s) * part.f, s * part.e + c * part.f, part.up};
    Pose out;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) out.R.m[3 * i + j] = rows[i][j];
    out.t = {place[0] + seen.eye.x - (c * part.middle.x - s * part.middle.y),
             place[1] + seen.eye.y - (s * part.middle.x + c * part.middle.y), -part.middle.z};
    return out;
}

OutlineFit refined(const Lying& part, const Start& start, const OutlineSeen& seen) {
    double place[2] = {part.place[0], part.place[1]}, yaw = 2 * PI * start.yaw / K;
    const double first = yaw;
    OutlineFit best;
    int shadow = start.shadow;
    const auto compare = [&] {
        const At now = at(part, place, yaw, seen);
        double cost = 1e300;
        int nearest = shadow;
        for (int w = shadow - COARSE; w <= shadow + COARSE; ++w) {
            const double own = cost_of(now.beyond, nullptr, (w + K) % K, part.height, seen);
            if (own < cost) cost = own, nearest = (w + K) % K;
        }
        shadow = nearest;
        if (cost < best.cost) best.cost = cost, best.pose = pose_of(part, place, yaw, seen);
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

double OutlineSeen::from_eye(int k) const {
    return reach[k] + (middle[0] - eye.x) * circle().c[k] + (middle[1] - eye.y) * circle().s[k];
}

OutlineFit fit_outline(const std::vector<Vec3>& points, const Vec3& down, const OutlineSeen& seen) {
    OutlineFit best;
    best.cost = seen.most;
    if (points.empty() || !(squared(down) > 0)) return best;
    double low = 1e300, high = -1e300;
    for (const Vec3& p : points) {
        low = std::min(low, dot(down, p));
        high = std::max(high, dot(down, p));
    }
    if (!((high - low) / norm(down) < HIGHEST * seen.eye.z)) return best;
    const Lying part = lying(points, down, seen);
    for (const Start& start : starts(part, seen)) {
        const OutlineFit found = refined(part, start, seen);
        if (found.cost < best.cost) best = found;
    }
    return best;
}

}  // namespace tanteo
