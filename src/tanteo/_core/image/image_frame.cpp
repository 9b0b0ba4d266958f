#include "image/image_frame.hpp"

#include <cmath>

namespace tanteo {

namespace {

constexpr size_t MOST_VIEWS = 4096;

std::vector<Box> boxes_of(const std::vector<Vec3>& corners) {
    std::vector<Box> out(corners.size() / 3);
    for (size_t k = 0; k < corners.size(); ++k) out[k / 3].add(corners[k]);
    return out;
}

}  // namespace

EdgeFrame::EdgeFrame(std::vector<EdgeSample> samples, const std::vector<Vec3>& normals, std::vector<char> sharp,
                     const std::vector<Vec3>& corners, double diagonal, const Vec3& middle, double slack,
                     double view_step)
    : samples(std::move(samples)),
      diagonal(diagonal),
      middle(middle),
      sharp(std::move(sharp)),
      slack(slack),
      view_step(view_step) {
    for (size_t k = 0; k < size(); ++k) {
        const Vec3 &at = this->samples[k].at, lift = normals[2 * k] + normals[2 * k + 1];
        for (size_t j = 2 * k; j < 2 * k + 2; ++j) sides.push_back({normals[j], dot(at, normals[j])});
        lifted.push_back(at + (slack / std::max(norm(lift), 1e-9)) * lift);
    }
    for (size_t k = 0; k + 2 < corners.size(); k += 3)
        triangles.push_back({corners[k], corners[k + 1] - corners[k], corners[k + 2] - corners[k]});
    tree.build(boxes_of(corners));
}

bool EdgeFrame::crosses(int triangle, const Vec3& from, const Vec3& ray, double reach) const {
    const auto& [a, e1, e2] = triangles[triangle];  // Moeller and Trumbore 1997
    const Vec3 h = cross(ray, e2), s = from - a, q = cross(s, e1);
    const double det = dot(e1, h), sign = det < 0 ? -1 : 1, size = sign * det, edge = 1e-9 * size;
    const double u = sign * dot(s, h), v = sign * dot(ray, q), along = sign * dot(e2, q);
    return size > 1e-300 && u >= -edge && v >= -edge && u + v <= size + edge && along > 0 && along < reach * size;
}

bool EdgeFrame::hides(const Vec3& eye, const Vec3& target, int& by) const {
    const Vec3 ray = target - eye;
    const double reach = 1 - slack / norm(ray);
    // the triangle that hides one sample often hides the next
    if (by >= 0 && crosses(by, eye, ray, reach)) return true;
    by = -1;
    tree.cast(eye, ray, reach, [&](int t, double nearest) {
        if (nearest > 0 && crosses(t, eye, ray, reach)) by = t;
        return by < 0 ? 1e300 : -1.0;  // one is enough
    });
    return by >= 0;
}

void EdgeFrame::mark(const Vec3& eye, bool hidden, char* shown, char* rims) const {
    int by = -1;
    for (size_t k = 0; k < size(); ++k) {
        const Side &one = sides[2 * k], &other = sides[2 * k + 1];
        const bool first = dot(eye, one.normal) > one.offset, second = dot(eye, other.normal) > other.offset;
        rims[k] = first != second;
        shown[k] = (rims[k] || (sharp[k] && first && second)) && !(hidden && hides(eye, lifted[k], by));
    }
}

// A part is seldom larger than a tenth of its distance, so that ten steps of the distance turn no ray by more than a step.
std::shared_ptr<const EdgeView> EdgeFrame::view_from(const Vec3& eye) const {
    const Vec3 off = eye - middle;
    const double apart = 10 * view_step, far = std::round(std::log(std::max(norm(off), 1e-9)) / apart);
    const Vec3 at = (1 / (std::max(norm(off), 1e-9) * view_step)) * off;
    const std::array<int64_t, 4> key{static_cast<int64_t>(far), std::llround(at.x), std::llround(at.y), std::llround(at.z)};
    {
        const std::lock_guard<std::mutex> lock(mutex);
        const auto known = views.find(key);
        if (known != views.end()) return known->second;
    }
    auto view = std::make_shared<EdgeView>();
    view->shown.resize(size());
    view->rims.resize(size());
    const double step = std::exp(far * apart) * view_step;
    mark(middle + step * Vec3{double(key[1]), double(key[2]), double(key[3])}, true, view->shown.data(), view->rims.data());
    const std::lock_guard<std::mutex> lock(mutex);
    if (views.size() >= MOST_VIEWS) views.clear();
    return views.emplace(key, std::move(view)).first->second;
}

}  // namespace tanteo
