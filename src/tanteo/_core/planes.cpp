#include "planes.hpp"

#include <algorithm>
#include <cmath>

namespace tanteo {

namespace {

constexpr double SDS = 4;           // within which angles agree
constexpr double MADE = 0.004;      // and so much more [rad]: faces are not made, nor meshed, as they are drawn
constexpr double INDEPENDENT = 0.1; // triple product of three normals that fix a pose
constexpr double ROUND = 2e-4;      // how far a cylinder may be off its mesh, about [m]
constexpr int STEPS = 4;            // of Gauss and Newton to all planes that are on faces
constexpr int REFINED = 12;         // poses that are refined
constexpr int SLIDES = 4;           // places along a direction that no plane fixes

double gate(const SensedPlane& a, const SensedPlane& b) { return SDS * std::hypot(a.tilt, b.tilt) + MADE; }

// One sensed plane at a pose: the least it costs, how far it is from the surface that it is of, if of any, and the normal
// of that, in the part.
struct Match {
    double cost;
    bool found;
    Vec3 normal;
    double height;
};

class Comparison {
  public:
    Comparison(const ModelFaces& all, const std::vector<SensedPlane>& sensed)
        : faces(all.planes), rounds(all.rounds), sensed(sensed) {}

    // turned: how well the attitude is known [rad]; about: from where it is [m]
    Match match(const SensedPlane& plane, const Pose& pose, double turned, const Vec3& about) const {
        const Vec3 n = transposed_times(pose.R, plane.normal), p = into_part(pose, plane.at);
        const double tilt2 = plane.tilt * plane.tilt + turned * turned + MADE * MADE;
        const double lever = norm(plane.at - about), sd2 = plane.sd * plane.sd + turned * turned * lever * lever;
        const double near = std::cos(std::min(SDS * std::sqrt(tilt2), 1.5));
        Match best{plane.most, false, {}, 0};
        for (size_t k = 0; k < faces.size(); ++k) {
            const ModelPlane& face = faces[k];
            double c = dot(n, face.normal);
            if (!plane.sided) c = std::fabs(c);
            if (c < near) continue;
            const Vec3 off = p - face.centre;
            const double h = dot(off, face.normal), h2 = h * h, cost = 0.5 * h2 / sd2 + (1 - c) / tilt2;
            if (cost >= best.cost) continue;
            const double room = face.reach + 0.5 * plane.span + SDS * std::sqrt(sd2);
            if (squared(off) - h2 > room * room) continue;
            best = {cost, true, face.normal, h};
        }
        if (plane.alone) on_rounds(n, p, near, sd2 + ROUND * ROUND, tilt2, best);
        return best;
    }

    double cost(const Pose& pose, double turned, const Vec3& about, double limit) const {
        double sum = 0;
        for (const SensedPlane& plane : sensed) {
            sum += match(plane, pose, turned, about).cost;
            if (sum > limit) break;
        }
        return sum;
    }

    // Moves a pose to where all planes are nearest to the faces and cylinders that they are of; the cost there.
    PlanePose refined(Pose pose, double turned, const Vec3& about) const {
        for (int step = 0; step < STEPS; ++step) {
            double A[36] = {}, b[6] = {};
            for (int i = 0; i < 6; ++i) A[7 * i] = 1e-6;
            for (const SensedPlane& plane : sensed) {
                const Match to = match(plane, pose, turned, about);
                if (!to.found) continue;
                const Vec3 p = into_part(pose, plane.at), &n = to.normal;
                const Vec3 own = transposed_times(pose.R, plane.normal), sign = dot(own, n) < 0 ? -own : own;
                const Vec3 turn = cross(p, n);
                const double J[6] = {-n.x, -n.y, -n.z, -turn.x, -turn.y, -turn.z};
                add(A, b, J, to.height, 1 / (plane.sd * plane.sd + 1e-14));
                // own normal in the part turns by -w x n: two directions across the face's normal
                const Vec3 u = any_across(n), v = cross(n, u);
                for (const Vec3& e : {u, v}) {
                    const Vec3 g = cross(sign, e);
                    const double K[6] = {0, 0, 0, -g.x, -g.y, -g.z};
                    add(A, b, K, dot(sign, e), 1 / (plane.tilt * plane.tilt + MADE * MADE));
                }
            }
            if (!cholesky(A, 6)) break;
            solve_cholesky(A, 6, b);
            pose = moved(pose, {b[0], b[1], b[2]}, {b[3], b[4], b[5]}, Vec3{});
            turned *= 0.25;
        }
        return {pose, cost(pose, 0, about, 1e300)};
    }

  private:
    const std::vector<ModelPlane>& faces;
    const std::vector<ModelRound>& rounds;
    const std::vector<SensedPlane>& sensed;

    // A point with its normal on the cylinders, where one is nearer than the best plane.
    void on_rounds(const Vec3& n, const Vec3& p, double near, double sd2, double tilt2, Match& best) const {
        const double sd = std::sqrt(sd2);
        for (const ModelRound& round : rounds) {
            const Vec3 off = p - round.middle;
            const double t = dot(off, round.axis);
            if (std::fabs(t) > round.half + SDS * sd) continue;
            const Vec3 across = off - t * round.axis;
            const double d = norm(across), h = d - round.radius;
            if (0.5 * h * h > best.cost * sd2 || !(d > 0)) continue;
            const double c = round.sign / d * dot(n, across), cost = 0.5 * h * h / sd2 + (1 - c) / tilt2;
            if (c >= near && cost < best.cost) best = {cost, true, round.sign / d * across, round.sign * h};
        }
    }

    static void add(double* A, double* b, const double* J, double r, double weight) {
        for (int i = 0; i < 6; ++i) {
            b[i] -= weight * J[i] * r;
            for (int k = 0; k <= i; ++k) A[6 * i + k] += weight * J[i] * J[k];
        }
    }
};

// Right-handed axes: along the first, and across it and the second.
Mat3 frame(const Vec3& a, const Vec3& b) {
    const Vec3 z = unit(cross(a, b)), y = cross(z, a);
    return {{a.x, y.x, z.x, a.y, y.y, z.y, a.z, y.z, z.z}};
}

// x with n[i] . x = h[i]
bool meeting(const Vec3* n, const double* h, double det, Vec3& x) {
    if (!(std::fabs(det) > 1e-6)) return false;
    x = (1 / det) * (h[0] * cross(n[1], n[2]) + h[1] * cross(n[2], n[0]) + h[2] * cross(n[0], n[1]));
    return true;
}

// Tries the faces that three sensed planes may be of, whose normals point so. The third, where it is one point, may be of
// a cylinder instead; where there is no third, the part is slid along what the two leave free.
class Triple {
  public:
    Triple(const ModelFaces& all, const std::vector<SensedPlane>& sensed, const int* rows,
           const Vec3* normals, double limit, std::vector<PlanePose>& out)
        : faces(all.planes), rounds(all.rounds), sensed(sensed), comparison(all, sensed), limit(limit), out(out) {
        count = rows[2] < 0 ? 2 : 3;
        for (int i = 0; i < count; ++i) {
            plane[i] = &sensed[rows[i]];
            n[i] = normals[i];
            about += (1.0 / count) * plane[i]->at;
            turned = std::max(turned, plane[i]->tilt);
        }
        if (count == 2) n[2] = unit(cross(n[0], n[1]));
        det = dot(n[0], cross(n[1], n[2]));
        world = frame(n[0], n[1]);
        for (int i = 0; i < (count == 2 ? 1 : 3); ++i) {
            const int j = (i + 1) % 3;
            const double angle = std::acos(std::clamp(dot(n[i], n[j]), -1.0, 1.0)), within = gate(*plane[i], *plane[j]);
            low[i] = std::cos(std::min(angle + within, 3.14159265));
            high[i] = std::cos(std::max(angle - within, 0.0));
        }
    }

    void run() {
        const int M = static_cast<int>(faces.size());
        for (int a = 0; a < M; ++a)
            for (int b = 0; b < M; ++b) {
                if (!agrees(0, a, b)) continue;
                if (count == 2) {
                    slid(a, b);
                    continue;
                }
                const Vec3 across = cross(faces[a].normal, faces[b].normal);
                for (int c = 0; c < M; ++c) {
                    if (dot(across, faces[c].normal) * det < 0.5 * INDEPENDENT * INDEPENDENT) continue;
                    if (agrees(1, b, c) && agrees(2, c, a)) tried(a, b, c);
                }
                if (plane[2]->alone && !rounds.empty()) rolled(a, b);
            }
    }

  private:
    const std::vector<ModelPlane>& faces;
    const std::vector<ModelRound>& rounds;
    const std::vector<SensedPlane>& sensed;
    Comparison comparison;
    double limit;
    std::vector<PlanePose>& out;
    const SensedPlane* plane[3] = {};
    int count = 3;
    Vec3 n[3], about;
    double det = 0, turned = 0, low[3] = {}, high[3] = {};
    Mat3 world;

    bool agrees(int pair, int a, int b) const {
        const double c = dot(faces[a].normal, faces[b].normal);
        return c >= low[pair] && c <= high[pair];
    }

    // The attitude that turns the normals of two faces to those of the first two planes.
    Mat3 attitude(int a, int b) const { return world * transposed(frame(faces[a].normal, faces[b].normal)); }

    void tried(int a, int b, int c) {
        Pose pose{attitude(a, b), {}};
        if (!placed(pose, a, b, faces[c].normal, dot(pose.R * faces[c].normal, plane[2]->at) - dot(faces[c].normal, faces[c].centre)))
            return;
        if (within(pose, a, 0) && within(pose, b, 1) && within(pose, c, 2)) compared(pose);
    }

    // The third point on the cylinders: its normal leads to their axis, or away from it.
    void rolled(int a, int b) {
        const Mat3 R = attitude(a, b);
        const Vec3 normal = transposed_times(R, n[2]);
        const double off = std::sin(std::min(gate(*plane[2], *plane[2]), 1.5));
        for (const ModelRound& round : rounds) {
            const double along = dot(normal, round.axis);
            if (std::fabs(along) > off) continue;
            const Vec3 out_of = unit(normal - along * round.axis), touched = round.middle + round.sign * round.radius * out_of;
            Pose pose{R, {}};
            if (!placed(pose, a, b, out_of, dot(R * out_of, plane[2]->at) - dot(out_of, touched))) continue;
            const double t = dot(into_part(pose, plane[2]->at) - round.middle, round.axis);
            if (std::fabs(t) > round.half + SDS * plane[2]->sd) continue;
            if (within(pose, a, 0) && within(pose, b, 1)) compared(pose);
        }
    }

    // The part at some places along the direction that its two faces leave free, no farther than it was felt.
    void slid(int a, int b) {
        const Mat3 R = attitude(a, b);
        const Vec3 free = unit(cross(faces[a].normal, faces[b].normal)), way = R * free;
        double first = 1e300, last = -1e300, low_at = 1e300, high_at = -1e300;
        for (const ModelPlane& face : faces) {
            first = std::min(first, dot(free, face.centre));
            last = std::max(last, dot(free, face.centre));
        }
        for (const SensedPlane& one : sensed) {
            low_at = std::min(low_at, dot(way, one.at));
            high_at = std::max(high_at, dot(way, one.at));
        }
        const double room = (last - first) - (high_at - low_at);
        for (int k = 0; k < SLIDES; ++k) {
            Pose pose{R, {}};
            if (!placed(pose, a, b, free, low_at - first - room * k / (SLIDES - 1.0))) return;
            compared(pose);
        }
    }

    // Sets where the part is: two faces go through where they were felt, and along a third normal it is that far.
    bool placed(Pose& pose, int a, int b, const Vec3& third, double height) const {
        const ModelPlane* face[2] = {&faces[a], &faces[b]};
        Vec3 m[3];
        double h[3];
        for (int i = 0; i < 2; ++i) {
            m[i] = pose.R * face[i]->normal;
            h[i] = dot(m[i], plane[i]->at) - dot(face[i]->normal, face[i]->centre);
        }
        m[2] = pose.R * third;
        h[2] = height;
        return meeting(m, h, dot(m[0], cross(m[1], m[2])), pose.t);
    }

    bool within(const Pose& pose, int face, int i) const {
        const double room = faces[face].reach + 0.5 * plane[i]->span + SDS * plane[i]->sd;
        return squared(into_part(pose, plane[i]->at) - faces[face].centre) <= 1.05 * room * room;
    }

    void compared(const Pose& pose) {
        const double cost = comparison.cost(pose, turned, about, limit);
        if (cost < limit) {
            out.push_back({pose, cost});
            if (out.size() > 4 * REFINED) shrink();
        }
    }

    void shrink() {
        const auto less = [](const PlanePose& x, const PlanePose& y) { return x.cost < y.cost; };
        std::nth_element(out.begin(), out.begin() + REFINED, out.end(), less);
        out.resize(REFINED);
        for (const PlanePose& one : out) limit = std::min(limit, std::max(one.cost + 12, 12.0));
    }
};

}  // namespace

std::vector<PlanePose> plane_poses(const ModelFaces& faces, const std::vector<SensedPlane>& sensed,
                                   const std::vector<int>& triples, double limit, int keep) {
    std::vector<PlanePose> rough, out;
    double turned = 0;
    Vec3 about;
    for (size_t k = 0; k + 2 < triples.size(); k += 3) {
        const int* rows = &triples[k];
        for (int signs = 0; signs < 8; ++signs) {
            Vec3 normals[3];
            bool meant = true;
            for (int i = 0; i < 3; ++i) {
                if (rows[i] < 0) {
                    meant = meant && !(signs >> i & 1);
                    continue;
                }
                const SensedPlane& plane = sensed[rows[i]];
                const bool back = signs >> i & 1;
                meant = meant && !(back && plane.sided);
                normals[i] = back ? -plane.normal : plane.normal;
            }
            if (meant) Triple(faces, sensed, rows, normals, limit, rough).run();
        }
        const int known = rows[2] < 0 ? 2 : 3;
        for (int i = 0; i < known; ++i) {
            turned = std::max(turned, sensed[rows[i]].tilt);
            about += (3.0 / known / triples.size()) * sensed[rows[i]].at;
        }
    }
    const auto less = [](const PlanePose& x, const PlanePose& y) { return x.cost < y.cost; };
    std::sort(rough.begin(), rough.end(), less);
    if (rough.size() > REFINED) rough.resize(REFINED);
    const Comparison comparison(faces, sensed);
    for (const PlanePose& one : rough) out.push_back(comparison.refined(one.pose, turned, about));
    std::sort(out.begin(), out.end(), less);
    if (static_cast<int>(out.size()) > keep) out.resize(keep);
    return out;
}

PlaneMatch match_plane(const ModelFaces& faces, const SensedPlane& plane, const Pose& pose) {
    static const std::vector<SensedPlane> none;
    const Match to = Comparison(faces, none).match(plane, pose, 0, plane.at);
    return {to.cost, to.found, to.normal, to.height};
}

}  // namespace tanteo
