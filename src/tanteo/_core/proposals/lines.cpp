#include "proposals/lines.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tanteo {

namespace {

constexpr double PARALLEL = 1e-3;  // sine up to which faces of a part share one line
constexpr double ONE = 1e-6;       // heights nearer than this are one [m]

double sine(const Vec3& a, const Vec3& b) { return norm(cross(a, b)); }

double squares(double x) { return x * x; }

void sort(Heights& heights) {
    for (auto* some : {&heights.planes, &heights.all}) {
        std::sort(some->begin(), some->end());
        const auto near = [](double a, double b) { return b - a < ONE; };
        some->erase(std::unique(some->begin(), some->end(), near), some->end());
    }
}

// How far the nearest of sorted numbers is beyond x.
double beyond(const std::vector<double>& sorted, double x) {
    double off = 1e300;
    for (const double one : sorted) {
        if (std::fabs(one - x) > std::fabs(off)) break;
        off = one - x;
    }
    return off;
}

const Heights& looking(const ModelLine& line, int sign) { return sign > 0 ? line.ahead : line.behind; }

// Nats of a line's planes near a shift: each on the face that is nearest there, then the shift as these have it; where
// they are no less than the limit, that.
Shift settled(const SensedLine& line, const ModelLine& faces, int turn, const std::vector<double>& most, double shift,
              double limit) {
    double out = 0, w = 0, wr = 0, wrr = 0;
    for (const auto& one : line.members) {
        const double height = turn * (one.height - shift), weight = 1 / (one.variance + faces.blur);
        double off = 1e300;
        for (const int sign : {1, -1}) {
            if (one.sign == -sign) continue;
            const double other = beyond(looking(faces, sign * turn).of(one.alone), height);
            if (std::fabs(other) < std::fabs(off)) off = other;
        }
        if (0.5 * weight * off * off < most[one.plane]) {
            w += weight;
            wr += weight * off;
            wrr += weight * off * off;
        } else if ((out += most[one.plane]) >= limit) {
            return {shift, limit};
        }
    }
    if (!(w > 0)) return {shift, out};
    return {shift - turn * wr / w, out + std::max(0.5 * (wrr - wr * wr / w), 0.0)};
}

// Puts a plane into the first line that it is parallel to.
void sort_in(const std::vector<SensedPlane>& sensed, int k, std::vector<SensedLine>& lines) {
    const SensedPlane& plane = sensed[k];
    SensedLine* own = nullptr;
    for (SensedLine& line : lines) {
        const SensedPlane& first = sensed[line.members[0].plane];
        const double room = agreement(first.tilt, plane.tilt);
        if (own || std::asin(std::min(sine(first.normal, plane.normal), 1.0)) > room) continue;
        own = &line;
        own->within = std::max(own->within, room);
    }
    if (!own) own = &lines.emplace_back();
    const Vec3 first = own->members.empty() ? plane.normal : sensed[own->members[0].plane].normal;
    const int sign = dot(first, plane.normal) < 0 ? -1 : 1;
    own->normal += (sign / (plane.tilt * plane.tilt + 1e-12)) * plane.normal;
    own->members.push_back({k, plane.sided ? sign : 0, 0, 0, plane.alone});
}

// Adds the walls of cylinders whose normals may look along a direction.
void add_walls(const ModelFaces& faces, double within, ModelLine& line) {
    for (const ModelRound& round : faces.rounds) {
        const double off = std::fabs(dot(round.axis, line.way)), middle = dot(round.middle, line.way);
        if (off > std::max(within, PARALLEL)) continue;
        if (off > PARALLEL) line.blur = std::max(line.blur, squares(off * round.half));
        line.ahead.all.push_back(middle + round.sign * round.radius);
        line.behind.all.push_back(middle - round.sign * round.radius);
    }
}

}  // namespace

std::vector<SensedLine> sensed_lines(const std::vector<SensedPlane>& sensed) {
    std::vector<int> order(sensed.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return sensed[a].tilt < sensed[b].tilt; });
    std::vector<SensedLine> out;
    for (const int k : order) sort_in(sensed, k, out);
    for (SensedLine& line : out) {
        const double count = static_cast<double>(line.members.size());
        double weight = 0;
        for (const auto& one : line.members) {
            weight += 1 / (squares(sensed[one.plane].tilt) + 1e-12);
            line.middle += (1 / count) * sensed[one.plane].at;
        }
        line.normal = unit(line.normal);
        line.tilt = 1 / std::sqrt(weight);
        for (auto& one : line.members) {
            const SensedPlane& plane = sensed[one.plane];
            // the line's tilt, two numbers, is shared by all: with this of its own for each they cost no more by it
            const double lever2 = squares(norm(cross(line.normal, plane.at - line.middle)));
            one.height = dot(line.normal, plane.at);
            one.variance = plane.sd * plane.sd + std::max(count / 2, 1.0) * line.tilt * line.tilt * lever2;
        }
    }
    return out;
}

void wall_line(const ModelFaces& faces, double within, ModelLine& line) {
    line.ahead.clear();
    line.behind.clear();
    line.blur = 0;
    add_walls(faces, within, line);
    sort(line.ahead);
    sort(line.behind);
}

void model_lines(const ModelFaces& faces, double within, std::vector<ModelLine>& out) {
    out.clear();
    for (const ModelPlane& face : faces.planes) {
        const auto one = [&](const ModelLine& line) { return sine(line.way, face.normal) < PARALLEL; };
        if (std::none_of(out.begin(), out.end(), one)) out.push_back({face.normal, {}, {}, 0});
    }
    const double room = std::max(std::sin(std::min(within, 1.5)), PARALLEL);
    for (ModelLine& line : out) {
        for (const ModelPlane& face : faces.planes) {
            const double off = sine(line.way, face.normal);
            if (off > room) continue;
            if (off > PARALLEL) line.blur = std::max(line.blur, squares(off * face.reach));
            Heights& heights = dot(line.way, face.normal) > 0 ? line.ahead : line.behind;
            heights.planes.push_back(dot(line.way, face.centre));
            heights.all.push_back(heights.planes.back());
        }
        add_walls(faces, room, line);
        sort(line.ahead);
        sort(line.behind);
    }
}

void shifts(const SensedLine& line, const ModelLine& faces, int turn, const std::vector<double>& most, double limit,
            std::vector<Shift>& out) {
    out.clear();
    double sd = 1e300;
    for (const auto& one : line.members) {
        sd = std::min(sd, std::sqrt(one.variance));
        for (const int sign : {1, -1}) {
            if (one.sign == -sign) continue;
            for (const double height : looking(faces, sign * turn).of(one.alone)) {
                const Shift found = settled(line, faces, turn, most, one.height - turn * height, limit);
                if (found.cost < limit) out.push_back(found);
            }
        }
    }
    std::sort(out.begin(), out.end(), [](const Shift& a, const Shift& b) { return a.cost < b.cost; });
    size_t kept = 0;  // one that is nearer than its noise to a better one leads to where that does
    for (size_t k = 0; k < out.size(); ++k) {
        const auto near = [&](const Shift& other) { return std::fabs(other.at - out[k].at) < 0.5 * sd; };
        if (std::none_of(out.begin(), out.begin() + kept, near)) out[kept++] = out[k];
    }
    out.resize(kept);
}

}  // namespace tanteo
