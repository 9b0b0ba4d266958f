#include "proposals/lines.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tanteo {

namespace {

constexpr double PARALLEL = 1e-3;  // sine up to which faces of a part share one direction
constexpr double ONE = 1e-6;       // heights closer than this are equal [m]

double sine(const Vec3& a, const Vec3& b) { return norm(cross(a, b)); }

double squares(double x) { return x * x; }

void sort(Heights& heights) {
    for (auto* some : {&heights.planes, &heights.all}) {
        std::sort(some->begin(), some->end());
        const auto near = [](double a, double b) { return b - a < ONE; };
        some->erase(std::unique(some->begin(), some->end(), near), some->end());
    }
}

// Signed distance from x to the nearest of sorted numbers.
double beyond(const std::vector<double>& sorted, double x) {
    double off = 1e300;
    for (const double one : sorted) {
        if (std::fabs(one - x) > std::fabs(off)) break;
        off = one - x;
    }
    return off;
}

const Heights& facing(const ModelLine& line, int sign) { return sign > 0 ? line.forward : line.backward; }

// Cost of a line's planes near a shift [nats], each on its nearest face, and the shift refined on these faces. Returns the
// limit if the cost is not below it.
Shift refined(const SensedLine& line, const ModelLine& faces, int turn, const std::vector<double>& most, double shift,
              double limit) {
    double out = 0, w = 0, wr = 0, wrr = 0;
    for (const auto& one : line.members) {
        const double height = turn * (one.height - shift), weight = 1 / (one.variance + faces.blur);
        double off = 1e300;
        for (const int sign : {1, -1}) {
            if (one.sign == -sign) continue;
            const double other = beyond(facing(faces, sign * turn).of(one.alone), height);
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

// Adds a plane to the first line that is parallel to it.
void sort_in(const std::vector<SensedPlane>& sensed, int k, std::vector<SensedLine>& lines) {
    const SensedPlane& plane = sensed[k];
    SensedLine* own = nullptr;
    for (SensedLine& line : lines) {
        const SensedPlane& first = sensed[line.members[0].plane];
        const double tolerance = agreement(first.tilt, plane.tilt);
        if (own || std::asin(std::min(sine(first.normal, plane.normal), 1.0)) > tolerance) continue;
        own = &line;
        own->within = std::max(own->within, tolerance);
    }
    if (!own) own = &lines.emplace_back();
    const Vec3 first = own->members.empty() ? plane.normal : sensed[own->members[0].plane].normal;
    const int sign = dot(first, plane.normal) < 0 ? -1 : 1;
    own->normal += (sign / (plane.tilt * plane.tilt + 1e-12)) * plane.normal;
    own->members.push_back({k, plane.sided ? sign : 0, 0, 0, plane.alone});
}

// Adds the walls of cylinders whose normals may be along a direction.
void add_walls(const ModelFaces& faces, double within, ModelLine& line) {
    for (const ModelRound& round : faces.rounds) {
        const double off = std::fabs(dot(round.axis, line.direction)), middle = dot(round.middle, line.direction);
        if (off > std::max(within, PARALLEL)) continue;
        if (off > PARALLEL) line.blur = std::max(line.blur, squares(off * round.half));
        line.forward.all.push_back(middle + round.sign * round.radius);
        line.backward.all.push_back(middle - round.sign * round.radius);
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
            // the tilt of the line, two numbers, is shared by all planes: this inflation as if it were independent bounds its effect
            const double lever2 = squares(norm(cross(line.normal, plane.at - line.middle)));
            one.height = dot(line.normal, plane.at);
            one.variance = plane.sd * plane.sd + std::max(count / 2, 1.0) * line.tilt * line.tilt * lever2;
        }
    }
    return out;
}

void wall_line(const ModelFaces& faces, double within, ModelLine& line) {
    line.forward.clear();
    line.backward.clear();
    line.blur = 0;
    add_walls(faces, within, line);
    sort(line.forward);
    sort(line.backward);
}

void model_lines(const ModelFaces& faces, double within, std::vector<ModelLine>& out) {
    out.clear();
    for (const ModelPlane& face : faces.planes) {
        const auto one = [&](const ModelLine& line) { return sine(line.direction, face.normal) < PARALLEL; };
        if (std::none_of(out.begin(), out.end(), one)) out.push_back({face.normal, {}, {}, 0});
    }
    const double largest = std::max(std::sin(std::min(within, 1.5)), PARALLEL);
    for (ModelLine& line : out) {
        for (const ModelPlane& face : faces.planes) {
            const double off = sine(line.direction, face.normal);
            if (off > largest) continue;
            if (off > PARALLEL) line.blur = std::max(line.blur, squares(off * face.reach));
            Heights& heights = dot(line.direction, face.normal) > 0 ? line.forward : line.backward;
            heights.planes.push_back(dot(line.direction, face.centre));
            heights.all.push_back(heights.planes.back());
        }
        add_walls(faces, largest, line);
        sort(line.forward);
        sort(line.backward);
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
            for (const double height : facing(faces, sign * turn).of(one.alone)) {
                const Shift found = refined(line, faces, turn, most, one.height - turn * height, limit);
                if (found.cost < limit) out.push_back(found);
            }
        }
    }
    std::sort(out.begin(), out.end(), [](const Shift& a, const Shift& b) { return a.cost < b.cost; });
    size_t kept = 0;  // shifts within the noise of a better one are duplicates
    for (size_t k = 0; k < out.size(); ++k) {
        const auto near = [&](const Shift& other) { return std::fabs(other.at - out[k].at) < 0.5 * sd; };
        if (std::none_of(out.begin(), out.begin() + kept, near)) out[kept++] = out[k];
    }
    out.resize(kept);
}

}  // namespace tanteo
