#include "proposals/plane_search.hpp"

#include <algorithm>
#include <cmath>

#include "solve/plane_fit.hpp"

namespace tanteo {

namespace {

constexpr double INDEPENDENT = 0.1;  // least triple product of three directions that fix a position
constexpr size_t LEAST = 12;         // least number of poses that are refined: some lead to equal ones
constexpr int SLIDES = 4;            // number of positions along a direction that no plane fixes

// Rotation by a small vector, by slightly less than its length.
Mat3 turned(const Vec3& w) {
    const double s = 1 / (1 + 0.25 * squared(w));
    const Mat3 W{{0, -w.z, w.y, w.z, 0, -w.x, -w.y, w.x, 0}}, W2 = W * W;
    Mat3 R = identity();
    for (int i = 0; i < 9; ++i) R.m[i] += s * (W.m[i] + 0.5 * W2.m[i]);
    return R;
}

}  // namespace

PlaneSearch::PlaneSearch(const std::vector<SensedPlane>& sensed, const std::vector<int>& triples,
                         const std::vector<int>& walls)
    : sensed(sensed),
      lines(sensed_lines(sensed)),
      bases(plane_bases(sensed, lines, triples, walls)),
      middle(middle_of(sensed)) {
    for (const SensedLine& line : lines) within = std::max(within, line.within);
    apart = 1e300;
    for (const SensedPlane& one : sensed) apart = std::min(apart, one.sd);
    for (const PlaneBase& one : bases) known = std::max(known, std::sqrt(one.spread));
}

double PlaneSearch::none(int line) const {
    double out = 0;
    for (const auto& one : lines[line].members) out += (*most)[one.plane];
    return out;
}

std::vector<PlanePose> PlaneSearch::on(const ModelFaces& all, const std::vector<double>& nats, double upto, double largest_gap,
                                       int keep) {
    faces = &all;
    most = &nats;
    limit = upto;
    gap = largest_gap;
    most_poses = std::max(LEAST, static_cast<size_t>(keep));
    rough.clear();
    model_lines(*faces, within, model);
    tabled.assign(lines.size() * 2 * model.size(), 0);
    if (table.size() < tabled.size()) table.resize(tabled.size());
    for (const PlaneBase& one : bases) {
        base = &one;
        if (one.walls) on_walls(); else attitudes();
    }
    thinned();
    const PlaneFit fit(all, sensed, nats);
    std::vector<PlanePose> found;
    for (const Rough& one : rough) {
        if (one.at.cost >= upto) break;
        found.push_back(fit.refined(one.at.pose, one.turned, middle));
        upto = std::min(upto, found.back().cost + gap);
    }
    std::sort(found.begin(), found.end(), [](const PlanePose& a, const PlanePose& b) { return a.cost < b.cost; });
    std::vector<PlanePose> out;
    for (const PlanePose& each : found) {
        const auto one = [&](const PlanePose& other) { return are_one(other.pose, each.pose, known); };
        if (out.size() < static_cast<size_t>(keep) && std::none_of(out.begin(), out.end(), one)) out.push_back(each);
    }
    return out;
}

// Whether two poses agree within their uncertainty: rotation, and position of the middle of the sensed points.
bool PlaneSearch::are_one(const Pose& one, const Pose& other, double turn) const {
    double squares = 0;
    for (int m = 0; m < 9; ++m) squares += (one.R.m[m] - other.R.m[m]) * (one.R.m[m] - other.R.m[m]);
    return squares < 2 * turn * turn && squared(into_part(one, middle) - into_part(other, middle)) < apart * apart;
}

// The shifts of a sensed line onto a line of the part that cost less than the limit.
const std::vector<Shift>& PlaneSearch::shifts_of(int line, size_t i) {
    const size_t at = 2 * model.size() * line + i;
    if (!tabled[at]) shifts(lines[line], model[i / 2], i % 2 ? -1 : 1, *most, limit, table[at]);
    tabled[at] = 1;
    return table[at];
}

// Tries all attitudes with the first two lines along two lines of the part.
void PlaneSearch::attitudes() {
    for (size_t i = 0; i < 2 * model.size(); ++i) {
        if (shifts_of(base->first, i).empty()) continue;
        for (size_t k = 0; k < 2 * model.size(); ++k) {
            const double c = dot(direction_of(i), direction_of(k));
            if (i / 2 == k / 2 || c < base->low || c > base->high || shifts_of(base->second, k).empty()) continue;
            if (shifts_of(base->first, i)[0].cost + shifts_of(base->second, k)[0].cost < limit) attitude(i, k);
        }
    }
}

void PlaneSearch::attitude(size_t i, size_t k) {
    into = axes(direction_of(i), direction_of(k)) * base->frame;
    towards.assign(lines.size(), Vec3{});
    towards[base->first] = direction_of(i);
    towards[base->second] = direction_of(k);
    double others = 0, sum = shifts_of(base->first, i)[0].cost + shifts_of(base->second, k)[0].cost;
    along[2].clear();
    for (int j = 0; j < static_cast<int>(lines.size()) && sum + others < limit; ++j) {
        if (j == base->first || j == base->second) continue;
        const bool third = j == base->third;
        const double nats = other(j, third ? &along[2] : nullptr);
        if (!third) others += nats;
    }
    if (base->third >= 0) sum += along[2].empty() ? limit : along[2][0].cost;
    if (sum + others >= limit) return;
    const Vec3 free = unit(cross(direction_of(i), direction_of(k)));
    const Vec3 direction[3] = {direction_of(i), direction_of(k), base->third < 0 ? free : towards[base->third]};
    if (std::fabs(dot(direction[0], cross(direction[1], direction[2]))) < INDEPENDENT) return;
    average();
    prepare();
    along[0] = shifts_of(base->first, i);
    along[1] = shifts_of(base->second, k);
    place(0, base->first, direction[0]);
    place(1, base->second, direction[1]);
    if (base->third < 0) slides(free, along[2]); else place(2, base->third, direction[2]);
    placed(direction, others);
}

// Corrects the shifts along a line for the attitude, which turned it about its middle.
void PlaneSearch::place(int m, int line, const Vec3& direction) {
    const SensedLine& own = lines[line];
    const double off = dot(direction, into * own.middle) - dot(own.normal, own.middle);
    for (Shift& one : along[m]) one.at += off;
}

// Least cost of another line at the attitude [nats]; sets the direction of the part along which it then is, and returns all
// its shifts along that direction if requested.
double PlaneSearch::other(int line, std::vector<Shift>* all) {
    const Vec3 n = into * lines[line].normal;
    double best = none(line), nearest = base->near[line];
    size_t which = 2 * model.size();
    for (size_t i = 0; i < model.size(); ++i) {
        const double c = dot(n, model[i].direction);
        if (std::fabs(c) < base->near[line]) continue;
        const size_t own = 2 * i + (c < 0);
        if (!shifts_of(line, own).empty()) best = std::min(best, shifts_of(line, own)[0].cost);
        if (std::fabs(c) < nearest) continue;
        nearest = std::fabs(c);
        which = own;
    }
    if (which < 2 * model.size()) {
        towards[line] = direction_of(which);
        if (all) *all = shifts_of(line, which);
    } else if (!faces->rounds.empty()) {
        const double across = std::sqrt(1 - base->near[line] * base->near[line]);
        wall.direction = n;
        wall_line(*faces, across, wall);
        shifts(lines[line], wall, 1, *most, limit, wall_shifts);
        if (wall_shifts.empty()) return best;
        best = std::min(best, wall_shifts[0].cost);
        towards[line] = n;
        if (all) *all = wall_shifts;
    }
    return best;
}

// Refines the attitude so that all lines are along their directions.
void PlaneSearch::average() {
    Vec3 b;
    for (size_t j = 0; j < lines.size(); ++j)
        if (squared(towards[j]) > 0) b += lines[j].weight() * cross(lines[j].normal, transposed_times(into, towards[j]));
    into = turned(into * (base->covariance * b)) * into;
}

// Collects the planes at the attitude, each with the faces and walls of its direction.
void PlaneSearch::prepare() {
    planes.clear();
    options.clear();
    walls.clear();
    for (size_t k = 0; k < sensed.size(); ++k) {
        const SensedPlane& plane = sensed[k];
        const PlaneBase::Known& known = base->planes[k];
        Sensed one{into * plane.at, into * plane.normal, options.size(), 0, walls.size(), 0};
        for (const ModelPlane& face : faces->planes) {
            const double c = dot(one.normal, face.normal), agree = plane.sided ? c : std::fabs(c);
            if (agree < known.near) continue;
            const double reach = face.reach + known.reach, nats = (1 - agree) / known.tilt2;
            options.push_back({face.normal, face.centre, dot(face.normal, one.at - face.centre), reach * reach, nats});
        }
        one.last = options.size();
        for (const ModelRound& round : faces->rounds) {
            const double c = dot(one.normal, round.axis);
            if (plane.alone && c * c <= 1 - known.near * known.near) walls.push_back(round);
        }
        one.last_wall = walls.size();
        planes.push_back(one);
    }
}

// Shifts along the direction that two lines leave free, with the sensed points within the part.
void PlaneSearch::slides(const Vec3& direction, std::vector<Shift>& out) const {
    double first = 1e300, last = -1e300, low = 1e300, high = -1e300;
    for (const ModelPlane& face : faces->planes) {
        first = std::min(first, dot(direction, face.centre));
        last = std::max(last, dot(direction, face.centre));
    }
    for (const Sensed& one : planes) {
        low = std::min(low, dot(direction, one.at));
        high = std::max(high, dot(direction, one.at));
    }
    out.clear();
    for (int k = 0; k < SLIDES; ++k) out.push_back({low - first - (last - first - high + low) * k / (SLIDES - 1.0), 0});
}

// Tries the positions from shifts along three directions.
void PlaneSearch::placed(const Vec3* direction, double others) {
    const Vec3 &u = direction[0], &v = direction[1], &w = direction[2], vw = cross(v, w), wu = cross(w, u), uv = cross(u, v);
    const double scale = 1 / dot(u, vw);
    for (const Shift& a : along[0]) {
        if (a.cost + along[1][0].cost + along[2][0].cost + others >= limit) break;
        for (const Shift& b : along[1]) {
            if (a.cost + b.cost + along[2][0].cost + others >= limit) break;
            for (const Shift& c : along[2]) {
                if (a.cost + b.cost + c.cost + others >= limit) break;
                const Vec3 shift = scale * (a.at * vw + b.at * wu + c.at * uv);
                const double sum = cost(shift);
                if (sum < limit) keep(shift, sum);
            }
        }
    }
}

double PlaneSearch::cost(const Vec3& shift) const {
    double sum = 0;
    for (size_t k = 0; k < planes.size() && sum < limit; ++k) {
        const Sensed& one = planes[k];
        const PlaneBase::Known& known = base->planes[k];
        double best = (*most)[k];
        for (size_t m = one.first; m < one.last; ++m) {
            const Option& option = options[m];
            const double h = option.height - dot(option.normal, shift), h2 = h * h;
            const double own = 0.5 * h2 / known.variance + option.turned;
            if (own < best && squared(one.at - shift - option.centre) - h2 < option.reach2) best = own;
        }
        for (size_t m = one.first_wall; m < one.last_wall; ++m)
            best = on_wall(walls[m], one.normal, one.at - shift, known.variance, known.tilt2, best).cost;
        sum += best;
    }
    return sum;
}

void PlaneSearch::keep(const Vec3& shift, double cost) {
    const Mat3 R = transposed(into);
    rough.push_back({{{R, R * shift}, cost}, std::sqrt(base->spread)});
    limit = std::min(limit, cost + gap);
    if (rough.size() <= 4 * most_poses) return;
    thinned();
}

// Keeps the best poses; among poses that are equal within their uncertainty only one.
void PlaneSearch::thinned() {
    std::sort(rough.begin(), rough.end(), [](const Rough& a, const Rough& b) { return a.at.cost < b.at.cost; });
    size_t kept = 0;
    for (size_t k = 0; k < rough.size() && kept < most_poses; ++k) {
        const auto one = [&](const Rough& other) {
            return are_one(other.at.pose, rough[k].at.pose, std::max(other.turned, rough[k].turned));
        };
        if (std::none_of(rough.begin(), rough.begin() + kept, one)) rough[kept++] = rough[k];
    }
    rough.resize(kept);
}

}  // namespace tanteo
