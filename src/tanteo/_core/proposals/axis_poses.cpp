// Poses of a part from seeds: few sensed centres and planes on axes and faces with the same mutual distances and angles.
#include <algorithm>
#include <cmath>

#include "solve/axis_fit.hpp"

namespace tanteo {

namespace {

constexpr double PARALLEL = 1e-3;  // sine below which axes are parallel
constexpr double SHORT = 1e-6;     // length of a step at which the iteration ends
constexpr double HOPELESS = 100, NEARLY = 2;  // cost of a seed, over the limit of a pose, at which it is dropped: during and after the iteration
constexpr double SHARP = 0.05;  // least sine of two directions that fix an attitude
constexpr double PI = 3.14159265358979323846;
constexpr int TURNS = 3;  // number of turns about a direction with unknown rotation
constexpr int LATE = 4, STEPS = 12, REFINED = 12;
constexpr int TRIED = 4000;  // largest number of poses of a part that are tried

// An axis or face that may match an item of a seed; a plane of unknown side also matches with the opposite normal.
struct Partner {
    int which = 0;
    double sign = 1;
};

class Search {
  public:
    Search(const ModelAxes& axes, const ModelFaces& faces, const SensedScene& scene, double limit)
        : comparison(axes, faces, scene), axes(axes.all), faces(faces), scene(scene), limit(limit),
          C(static_cast<int>(scene.centres.size())) {
        for (const double share : axes.unseen) all = all && share < 1e-3;
    }

    void seed(const int* rows) {
        count = 0;
        while (count < 3 && rows[count] >= 0) {
            item[count] = rows[count];
            ++count;
        }
        chosen(0);
    }

    // Adds a pose that planes proposed, with its uncertainty.
    void start(const Pose& pose) {
        Spread known;
        PoseEquations at;
        for (const SensedPlane& plane : scene.planes) comparison.add_plane(at, plane, pose, known);
        if (!cholesky(at.information.data(), 6)) return;
        known.set(at.information.data());
        keep(pose, known);
    }

    AxisPoses found(int most) {
        const auto less = [](const Rough& x, const Rough& y) { return x.cost < y.cost; };
        std::sort(rough.begin(), rough.end(), less);
        if (rough.size() > REFINED) rough.resize(REFINED);
        AxisPoses out;
        for (const Rough& one : rough) out.best.push_back(comparison.refined(one.pose, one.known, limit));
        std::sort(out.best.begin(), out.best.end(), [](const PlanePose& x, const PlanePose& y) { return x.cost < y.cost; });
        if (static_cast<int>(out.best.size()) > most) out.best.resize(most);
        out.all = all;
        return out;
    }

  private:
    struct Rough {
        Pose pose;
        double cost;
        Spread known;
    };

    const AxisComparison comparison;
    const std::vector<ModelAxis>& axes;
    const ModelFaces& faces;
    const SensedScene& scene;
    double limit;
    int C, count = 0, item[3] = {}, tried = 0;
    Partner of[3];
    bool all = true;
    std::vector<Rough> rough;

    const SensedCentre& centre(int k) const { return scene.centres[item[k]]; }
    const SensedPlane& plane(int k) const { return scene.planes[item[k] - C]; }
    bool is_centre(int k) const { return item[k] < C; }
    Vec3 normal(int k) const { return of[k].sign * faces.planes[of[k].which].normal; }

    // Tries all partners of the next item of the seed that agree with those of the others.
    void chosen(int k) {
        if (k >= std::min(count, 3)) {
            if (beside()) placed();
            return;
        }
        const int options = static_cast<int>(is_centre(k) ? axes.size() : faces.planes.size());
        const bool both = !is_centre(k) && !plane(k).sided;
        for (int which = 0; which < options; ++which)
            for (const double sign : {1.0, -1.0}) {
                if ((sign < 0 && !both) || tried > TRIED) continue;
                of[k] = {which, sign};
                if (is_centre(k) && !comparison.fits.may_match(item[k], which)) continue;
                bool agree = true;
                for (int j = 0; j < k && agree; ++j) agree = together(j, k);
                if (agree) chosen(k + 1);
            }
    }

    bool together(int j, int k) const {
        const int a = of[j].which, b = of[k].which;
        if (is_centre(j) && is_centre(k)) return a != b && comparison.fits.agree(item[j], a, item[k], b);
        if (is_centre(j)) return over(j, k);
        const double c = std::clamp(dot(normal(j), normal(k)), -1.0, 1.0);
        const double sensed = std::clamp(dot(plane(j).normal, plane(k).normal), -1.0, 1.0);
        return a != b && std::fabs(std::acos(c) - std::acos(sensed)) < SDS * std::hypot(plane(j).tilt, plane(k).tilt) + AXIS_TURNED;
    }

    // Whether height and slope of a centre over a plane can be those of an axis over a face.
    bool over(int j, int k) const {
        const SensedCentre& c = centre(j);
        const SensedPlane& p = plane(k);
        const ModelAxis& axis = axes[of[j].which];
        const Vec3 n = normal(k), way = c.at - p.at;
        const double height = dot(way, p.normal), lever = norm(way - height * p.normal);
        const double within = SDS * std::sqrt(c.sd * c.sd + p.sd * p.sd + (lever * lever) * (p.tilt * p.tilt));
        const double base = dot(n, axis.middle - faces.planes[of[k].which].centre), rise = dot(n, axis.along);
        if ((axis.point || std::fabs(rise) < PARALLEL) && std::fabs(height - base) > within) return false;
        if (!c.oriented()) return true;
        const double sensed = std::acos(std::clamp(std::fabs(dot(c.axis, p.normal)), 0.0, 1.0));
        return std::fabs(sensed - std::acos(std::clamp(std::fabs(rise), 0.0, 1.0))) < SDS * std::hypot(c.tilt, p.tilt) + AXIS_TURNED;
    }

    // Whether the distance of two centres across a plane's normal is that of their axes, if these are along it.
    bool beside() const {
        if (count < 3 || !is_centre(1) || is_centre(2)) return true;
        const ModelAxis &a = axes[of[0].which], &b = axes[of[1].which];
        const Vec3 n = normal(2), way = centre(1).at - centre(0).at;
        if (a.point || b.point || norm(cross(a.along, n)) > PARALLEL || norm(cross(b.along, n)) > PARALLEL) return true;
        const double rise = dot(way, plane(2).normal), apart = norm(way - rise * plane(2).normal);
        const double sd2 = centre(0).sd * centre(0).sd + centre(1).sd * centre(1).sd + rise * rise * plane(2).tilt * plane(2).tilt;
        const double within = SDS * std::sqrt(sd2) + PARALLEL * (2 * a.wall + 2 * b.wall + std::fabs(rise));
        return std::fabs(apart - comparison.fits.least_apart(of[0].which, of[1].which)) < within;
    }

    // Proposes poses once all items of the seed have partners.
    void placed() {
        Vec3 world[3], part[3], directions[2], own[2];  // points and directions; a zero second direction is free
        int places = 0, ways = 0, free_sign = -1;
        for (int k = 0; k < count; ++k) {
            if (!is_centre(k)) {
                if (ways == 2) continue;
                directions[ways] = plane(k).normal;
                own[ways++] = normal(k);
                continue;
            }
            world[places] = centre(k).at;
            part[places++] = axes[of[k].which].middle;
        }
        if (places == 3) return of_three(world, part);
        for (int k = 0; k < count && ways < 2; ++k)
            if (is_centre(k) && centre(k).oriented() && (ways + (places == 2) < 2)) {
                directions[ways] = centre(k).axis;
                own[ways] = axes[of[k].which].along;
                free_sign = axes[of[k].which].point ? -1 : ways;
                ++ways;
            }
        if (!ways) return;
        if (places == 2) return of_two(world, directions[0], own[0], free_sign == 0);
        for (const double sign : {1.0, -1.0}) {
            if (sign < 0 && free_sign < 0) continue;
            if (free_sign >= 0) own[free_sign] = sign * own[free_sign];
            in_place(directions, own, places ? world[0] : Vec3{}, places ? part[0] : Vec3{});
        }
    }

    // Two centres and a direction: from points of parallel axes at the same distance, in both directions; otherwise from the
    // middles and ends of the walls.
    void of_two(const Vec3* world, const Vec3& direction, const Vec3& own, bool either) {
        const ModelAxis &a = axes[of[0].which], &b = axes[of[1].which];
        const auto between = [&](const Vec3& p, const Vec3& q) {
            const Vec3 there[2] = {direction, world[1] - world[0]};
            for (const double sign : {1.0, -1.0}) {
                const Vec3 here[2] = {sign * own, q - p};
                if (sign > 0 || either) in_place(there, here, 0.5 * (world[0] + world[1]), 0.5 * (p + q));
            }
        };
        if (is_parallel_to(a, own) && is_parallel_to(b, own)) return between(a.middle, b.middle);
        if (!a.point && !b.point && is_parallel_to(a, b.along)) {
            const Vec3 part[2] = {a.middle, b.middle};
            const double level = 0.5 * dot(a.along, b.middle - a.middle), high = 0.5 * rise(world, part, a.along, 0, 1).about;
            for (const double way : {high, -high})
                between(a.middle + (level - way) * a.along, b.middle + (way - level) * a.along);
            return;
        }
        between(a.middle, b.middle);
        for (const double s : {-0.5, 0.5})
            for (const double t : {-0.5, 0.5}) between(a.middle + s * a.wall * a.along, b.middle + t * b.wall * b.along);
    }

    static bool is_parallel_to(const ModelAxis& axis, const Vec3& way) {
        return axis.point || norm(cross(axis.along, unit(way))) < PARALLEL;
    }

    // Proposes poses from two directions and a point in the part frame, and in the world.
    void in_place(const Vec3* there, const Vec3* here, const Vec3& to, const Vec3& from) {
        Mat3 R;
        const int turns = turned(there[0], there[1], here[0], here[1], R) ? 1 : TURNS;
        for (int k = 0; k < turns; ++k) {
            const Mat3 Q = R * rotation((2 * PI * k / turns) * unit(here[0]));
            attempt({Q, to - Q * from});
        }
    }

    // The attitude that turns the first direction of the part to that of the world, and the second into the plane of both.
    // If one pair is nearly parallel, the turn about the first is arbitrary; returns false then.
    static bool turned(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d, Mat3& R) {
        const auto sharp = [](const Vec3& x, const Vec3& y) { return norm(cross(unit(x), y)) > SHARP * norm(y); };
        const auto frame = [](const Vec3& x, const Vec3& y) {
            const Vec3 e = unit(x), z = unit(cross(e, y)), f = cross(z, e);
            return Mat3{{e.x, f.x, z.x, e.y, f.y, z.y, e.z, f.z, z.z}};
        };
        const bool both = sharp(a, b) && sharp(c, d);
        R = frame(a, both ? b : any_across(a)) * transposed(frame(c, both ? d : any_across(c)));
        return both;
    }

    // Three centres: on parallel axes at the heights that their distances imply, in both directions.
    void of_three(const Vec3* world, Vec3* part) {
        const ModelAxis* axis[3];
        for (int k = 0; k < 3; ++k) axis[k] = &axes[of[k].which];
        bool parallel = true;
        for (int k = 0; k < 3; ++k) {
            parallel = parallel && !axis[k]->point;
            parallel = parallel && norm(cross(axis[0]->along, axis[k]->along)) < PARALLEL;
        }
        if (!parallel) {
            for (int which = 0; which < 9; ++which) {  // ends of the walls, then their middles
                Vec3 places[3];
                for (int k = 0; k < 3; ++k)
                    places[k] = part[k] + (which == 8 ? 0 : (which >> k & 1 ? 0.5 : -0.5) * axis[k]->wall) * axis[k]->along;
                on_places(world, places);
            }
            return;
        }
        const Vec3 u = axis[0]->along;
        const Rise second = rise(world, part, u, 0, 1), third = rise(world, part, u, 0, 2), last = rise(world, part, u, 1, 2);
        const bool level = last.overlaps(third.least - second.most, third.most - second.least) ||
                           last.overlaps(second.least - third.most, second.most - third.least);
        const bool across = last.overlaps(third.least + second.least, third.most + second.most);
        if (!level && !across) return;
        const double off = std::fabs(std::fabs(third.about - second.about) - last.about);
        const double sign = level && (!across || off < std::fabs(third.about + second.about - last.about)) ? 1 : -1;
        const double heights[3] = {0, second.about, sign * third.about};
        const double middle = dot(u, part[0] + part[1] + part[2]) / 3, mean = (heights[1] + heights[2]) / 3;
        const bool flat = std::max(second.about, third.about) < SDS * centre(0).sd;
        for (const double way : {1.0, -1.0}) {
            if (way < 0 && flat) continue;
            Vec3 places[3];
            for (int k = 0; k < 3; ++k) places[k] = part[k] + (middle + way * (heights[k] - mean) - dot(u, part[k])) * u;
            on_places(world, places);
        }
    }

    // Difference of heights of two centres along their axes that their distance implies, with its range.
    struct Rise {
        double least, about, most;
        bool overlaps(double from, double to) const { return from <= most && to >= least; }
    };
    Rise rise(const Vec3* world, const Vec3* part, const Vec3& u, int i, int j) const {
        const Vec3 off = part[j] - part[i], way = world[j] - world[i];
        const double square = squared(way) - squared(off - dot(off, u) * u), sd = std::hypot(centre(i).sd, centre(j).sd);
        const double within = SDS * sd * (2 * norm(way) + SDS * sd);
        const auto root = [](double x) { return std::sqrt(std::max(x, 0.0)); };
        return {root(square - within), root(square), root(square + within)};
    }

    void on_places(const Vec3* world, const Vec3* part) {
        Mat3 R;
        if (!turned(world[1] - world[0], world[2] - world[0], part[1] - part[0], part[2] - part[0], R)) return;
        const Vec3 there = (1.0 / 3) * (world[0] + world[1] + world[2]), from = (1.0 / 3) * (part[0] + part[1] + part[2]);
        attempt({R, there - R * from});
    }

    // Refines a pose so that the items of the seed are on their partners, and keeps it if it is cheap.
    void attempt(Pose pose) {
        if (++tried > TRIED) {
            all = false;
            return;
        }
        PoseEquations at = equations(pose);
        int step = 0;
        bool hopeless = false;
        // Levenberg's damping: if two heights are nearly equal, a step overshoots, which the diagonal does not show
        const auto damped = [](int i, double, double damping) {
            return damping * weak_prior(i, PoseEquations::STEP, PoseEquations::TURN);
        };
        maximize(at, STEPS, {0, 0.1, 0, 16, 16, INFINITY}, damped, [&](const double* by, double, const double*) {
            const Vec3 v = load(by), w = load(by + 3);
            hopeless = step++ >= LATE && at.cost > HOPELESS * limit;
            if (hopeless || squared(v) + squared(w) < SHORT * SHORT) return Attempt::LAST;
            const Pose next = moved(pose, v, w, Vec3{});
            const PoseEquations there = equations(next);
            if (there.cost > at.cost) return Attempt::REJECTED;
            pose = next;
            at = there;
            return Attempt::TAKEN;
        });
        if (hopeless || at.cost > NEARLY * limit || !cholesky(at.information.data(), 6)) return;
        Spread known;
        known.set(at.information.data());
        keep(pose, known);
    }

    PoseEquations equations(const Pose& pose) const {
        PoseEquations at;
        for (int k = 0; k < count; ++k) add_item(at, k, pose);
        return at;
    }

    void add_item(PoseEquations& at, int k, const Pose& pose) const {
        if (is_centre(k)) return AxisComparison::add_centre(at, centre(k), axes[of[k].which], pose);
        const SensedPlane& p = plane(k);
        const Vec3 n = normal(k), q = into_part(pose, p.at);
        at.place(n, q, dot(q - faces.planes[of[k].which].centre, n), 1 / (p.sd * p.sd + 1e-14));
        at.direction(transposed_times(pose.R, p.normal), n, 1 / (p.tilt * p.tilt + AXIS_TURNED * AXIS_TURNED));
    }

    void keep(const Pose& pose, const Spread& known) {
        const double sum = comparison.cost(pose, known, known, limit);
        if (!(sum < limit)) return;
        rough.push_back({pose, sum, known});
        if (rough.size() <= 4 * REFINED) return;
        std::nth_element(rough.begin(), rough.begin() + REFINED, rough.end(),
                         [](const Rough& x, const Rough& y) { return x.cost < y.cost; });
        rough.resize(REFINED);
    }
};

}  // namespace

AxisPoses axis_poses(const ModelAxes& axes, const ModelFaces& faces, const SensedScene& scene,
                     const std::vector<int>& seeds, const std::vector<Pose>& starts, double limit, int keep) {
    Search search(axes, faces, scene, limit);
    for (const Pose& pose : starts) search.start(pose);
    for (size_t k = 0; k + 2 < seeds.size(); k += 3) search.seed(&seeds[k]);
    return search.found(keep);
}

}  // namespace tanteo
