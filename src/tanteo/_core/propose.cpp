#include "propose.hpp"

#include <cmath>

#include "aim.hpp"
#include "normal.hpp"

namespace tanteo {

namespace {

constexpr double CAP = 9;         // cost of a point at most: it may be an outlier
constexpr double WRONG_SIDE = 4;  // of a beam that comes from within
constexpr size_t WINDOW = 256;    // samples among which a partner is looked for

struct Axes {  // a line and two directions across it
    Vec3 e, y, z;
    explicit Axes(const Vec3& along) : e(along), y(any_across(along)), z(cross(along, y)) {}
};

// Attitude that maps the part's axes on the world's, turned about the line by an angle.
Mat3 attitude(const Axes& world, const Axes& part, double c, double s) {
    Mat3 R;
    const Vec3 y = c * part.y + s * part.z, z = -s * part.y + c * part.z;
    add_outer(R, 1, world.e, part.e);
    add_outer(R, 1, world.y, y);
    add_outer(R, 1, world.z, z);
    return R;
}

// Capped cost of a centre: how far it is from the nearest axis or centre, and how far its own axis is tilted to that.
double cost_of_centre(const Shape& shape, const Point& point, const Pose& pose, double per, double per_tilt) {
    Vec3 off;
    const int k = shape.nearest_axis(point, into_part(pose, point.at), off);
    if (k < 0) return CAP;
    double cost = squared(off) * per;
    if (point.oriented) {
        const double cosine = dot(pose.R * shape.axes[k].direction, point.normal);
        cost += 2 * (1 - (point.kind == Kind::APEX ? cosine : std::fabs(cosine))) * per_tilt;
    }
    return std::min(cost, CAP);
}

// A place of the part where a point may be: on its surface, on an axis, a centre; the normal there, or the axis.
struct Where {
    Vec3 at, normal;
};

// Places to choose from for a point: k counts on for ever.
class Places {
  public:
    Places(const Shape& shape, const Point& point) : shape(shape), point(point) {
        heights = point.kind == Kind::CENTRE ? HEIGHTS : 1;
        if (!point.amid()) return;
        for (size_t k = 0; k < shape.axes.size(); ++k)
            if (shape.axes[k].may_have(point, 4 * point.circle_sd)) axes.push_back(k);
    }
    size_t size() const { return point.amid() ? heights * axes.size() : shape.samples.size(); }
    Where operator[](size_t k) const {
        if (!point.amid()) {
            const Vec3& n = shape.sample_normals[k];
            return {shape.samples[k] + point.radius * n, n};
        }
        const RoundAxis& axis = shape.axes[axes[k / heights]];
        if (heights == 1) return {axis.start(point), axis.direction};
        const double t = static_cast<double>(k % HEIGHTS / 2) / (HEIGHTS / 2 - 1);
        return {axis.a + (t * axis.length) * axis.direction, k % 2 ? -axis.direction : axis.direction};
    }

  private:
    static constexpr size_t HEIGHTS = 10;  // five places along an axis, each with both directions
    size_t heights = 1;
    const Shape& shape;
    const Point& point;
    std::vector<size_t> axes;
};

}  // namespace

double score(const Shape& shape, const Problem& problem, const std::vector<int>& rows, const Pose& pose, double blur,
             double tilt, double limit) {
    const double per = 1 / (blur * blur), per_tilt = 1 / (tilt * tilt);
    double sum = 0;
    for (const int j : rows) {
        const Point& point = problem.points[j];
        if (point.amid()) {
            sum += cost_of_centre(shape, point, pose, per, per_tilt);
            if (sum > limit) break;
            continue;
        }
        int flat = 0;
        const bool faces = point.oriented || point.sided;
        const double f = shape.field(into_part(pose, point.at), faces ? &flat : nullptr) - point.radius;
        double cost = f * f * per;
        if (faces) {
            const Vec3 n = pose.R * shape.flats[flat].normal;
            if (point.oriented) cost += 2 * (1 - dot(n, point.normal)) * per_tilt;
            if (point.sided && dot(n, point.direction) > CLEARLY) cost += WRONG_SIDE;
        }
        sum += std::min(cost, CAP);
        if (sum > limit) break;
    }
    return sum;
}

std::vector<Proposal> propose(const Shape& shape, const Problem& problem, const std::vector<int>& rows,
                              const std::vector<int>& pairs, const Effort& effort, Random& random) {
    std::vector<Proposal> got;
    std::vector<double> heap;
    std::vector<int> partners;
    double bound = 1e300;
    for (size_t k = 0; k + 1 < pairs.size(); k += 2) {
        const Point &P = problem.points[pairs[k]], &Q = problem.points[pairs[k + 1]];
        const double gap = norm(Q.at - P.at);
        if (!(gap > 0)) continue;
        const Axes world((1 / gap) * (Q.at - P.at));
        const Places firsts(shape, P), seconds(shape, Q);
        if (!firsts.size() || !seconds.size()) continue;
        const bool oriented = P.oriented && Q.oriented;
        const Vec3 middle = 0.5 * (P.at + Q.at);
        const double low = std::max(gap - effort.tolerance, 0.0), high = gap + effort.tolerance;
        int done = 0;
        for (int tries = 0; done < effort.per_pair && tries < 3 * effort.per_pair; ++tries) {
            const auto [A, na] = firsts[random.next() % firsts.size()];
            const auto fits = [&, A = A, na = na](const Where& there) {
                const auto& [B, nb] = there;
                const double d2 = squared(B - A);
                if (!(d2 > 0) || d2 < low * low || d2 > high * high) return false;
                if (!oriented) return true;
                const Vec3 e = (1 / std::sqrt(d2)) * (B - A);
                return std::fabs(dot(na, e) - dot(P.normal, world.e)) < 2 * effort.tilt &&
                       std::fabs(dot(nb, e) - dot(Q.normal, world.e)) < 2 * effort.tilt &&
                       std::fabs(dot(na, nb) - dot(P.normal, Q.normal)) < 2.5 * effort.tilt;
            };
            partners.clear();
            const size_t window = random.next() % seconds.size();  // samples come in no order: some in a row are some of all
            const size_t some = Q.amid() ? seconds.size() : std::min(WINDOW, seconds.size());
            for (size_t k = 0; k < some; ++k) {
                const size_t b = (window + k) % seconds.size();
                if (fits(seconds[b])) partners.push_back(static_cast<int>(b));
            }
            if (partners.empty()) continue;
            const auto [B, nb] = seconds[partners[random.next() % partners.size()]];
            const double length = norm(B - A);
            if (!(length > 0)) continue;
            const Axes part((1 / length) * (B - A));
            ++done;
            double first = 0, step = 2 * PI / effort.spins;
            int spins = effort.spins;
            if (oriented) {  // the spin that turns both normals best
                double c = 0, s = 0;
                for (int w = 0; w < 2; ++w) {
                    const Vec3 &m = w ? Q.normal : P.normal, &g = w ? nb : na;
                    const double my = dot(m, world.y), mz = dot(m, world.z), gy = dot(g, part.y), gz = dot(g, part.z);
                    c += my * gy + mz * gz;
                    s += my * gz - mz * gy;
                }
                if (std::hypot(c, s) > 0.3) {
                    step = 0.7 * effort.tilt;
                    first = std::atan2(s, c) - step;
                    spins = 3;
                }
            }
            Proposal best{{}, 1e300};
            double c = std::cos(first), s = std::sin(first);
            const double dc = std::cos(step), ds = std::sin(step);
            for (int spin = 0; spin < spins; ++spin) {
                Pose pose;
                pose.R = attitude(world, part, c, s);
                const double next = c * dc - s * ds;
                s = s * dc + c * ds;
                c = next;
                pose.t = middle - pose.R * (0.5 * (A + B));
                const double limit = std::min(best.cost, bound);
                const double cost = score(shape, problem, rows, pose, effort.blur, effort.tilt, limit);
                if (cost < limit) best = {pose, cost};
            }
            if (!(best.cost < bound)) continue;
            got.push_back(best);
            heap.push_back(best.cost);
            std::push_heap(heap.begin(), heap.end());
            if (static_cast<int>(heap.size()) > effort.keep + effort.keep / 2) {
                std::pop_heap(heap.begin(), heap.end());
                heap.pop_back();
                bound = heap.front();
            }
        }
    }
    return thinned(shape, std::move(got), effort.keep, 0.5 * effort.blur, 0.5 * effort.blur / (0.25 * shape.diagonal));
}

std::vector<Proposal> thinned(const Shape& shape, std::vector<Proposal> all, int keep, double near, double near_turn) {
    std::stable_sort(all.begin(), all.end(), [](const Proposal& a, const Proposal& b) { return a.cost < b.cost; });
    std::vector<Proposal> kept;
    for (const Proposal& one : all) {
        if (static_cast<int>(kept.size()) >= keep) break;
        bool same = false;
        for (const Proposal& other : kept) {
            Vec3 v, w;
            difference(other.pose, one.pose, shape.centre, v, w);
            same = squared(v) < near * near && squared(w) < near_turn * near_turn;
            if (same) break;
        }
        if (!same) kept.push_back(one);
    }
    return kept;
}

}  // namespace tanteo
