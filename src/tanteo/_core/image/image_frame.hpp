// The edges of a part as samples, their visibility from a camera, and refinement of the pose on the edges of an image.
#pragma once
#include <array>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "shape/bvh.hpp"
#include "image/image_edge.hpp"

namespace tanteo {

// Visible samples of edges from a camera centre, and those on the outline (rim).
struct EdgeView {
    std::vector<char> shown, rims;
};

class EdgeFrame {
  public:
    // normals: two for each sample, those of its adjacent faces; corners: three for each triangle of the surface;
    // slack: distance by which a sample is lifted off the surface for the visibility test [m]; view_step: angle between two
    // camera centres that share a view [rad]
    EdgeFrame(std::vector<EdgeSample> samples, const std::vector<Vec3>& normals, std::vector<char> sharp,
              const std::vector<Vec3>& corners, double diagonal, const Vec3& middle, double slack, double view_step);

    size_t size() const { return samples.size(); }
    // Marks whether each sample is a visible edge at a pose in the camera frame, and whether it is on the outline (rim);
    // hidden: whether to exclude samples that the part itself hides.
    void mark(const Pose& T, bool hidden, char* shown, char* rims) const { mark(into_part(T, {}), hidden, shown, rims); }
    // The same for a camera centre in the part frame.
    void mark(const Vec3& eye, bool hidden, char* shown, char* rims) const;
    // The view from the point nearest to a camera centre (part frame) on a grid of directions and distances, for all
    // callers. It does not depend on earlier calls.
    std::shared_ptr<const EdgeView> view_from(const Vec3& eye) const;

    std::vector<EdgeSample> samples;
    double diagonal;
    Vec3 middle;

  private:
    struct Side {
        Vec3 normal;
        double offset;
    };
    struct Triangle {
        Vec3 a, e1, e2;
    };
    bool crosses(int triangle, const Vec3& from, const Vec3& ray, double reach) const;
    bool hides(const Vec3& eye, const Vec3& target, int& by) const;

    std::vector<Side> sides;  // two for each sample
    std::vector<char> sharp;
    std::vector<Vec3> lifted;
    std::vector<Triangle> triangles;
    Bvh tree;
    double slack, view_step;
    mutable std::mutex mutex;
    mutable std::map<std::array<int64_t, 4>, std::shared_ptr<const EdgeView>> views;
};

struct Round {  // of a refinement
    double reach;     // largest distance of a matched edge point [px]
    bool visibility;  // whether to compute the visibility of samples again
};

struct EdgeErrors {
    double bias, correlation;  // error common to an edge, and correlation length of the noise [px]
};

// Robust Gauss-Newton refinement of a pose on the offsets of edges. The prior has its mean at `start` and an information
// (6 x 6, lower triangle) on shifts in units of the part's diagonal and turns [rad] about its middle.
Pose refined(const EdgeFrame& frame, const Lens& lens, const EdgePoints& points, const Pose& pose, const Pose& start,
             const double* prior, const std::vector<Round>& rounds, const EdgeErrors& errors);

}  // namespace tanteo
