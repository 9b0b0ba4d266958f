// The edges of a part as samples, which of them an eye sees, and the pose at which they meet an image's best.
#pragma once
#include <vector>

#include "shape/bvh.hpp"
#include "image/image_edge.hpp"

namespace tanteo {

class EdgeFrame {
  public:
    // normals: two for each sample, of the faces that meet there; corners: three for each triangle of the surface;
    // slack: how far a sample is lifted off the surface when it is asked whether it is hidden [m]
    EdgeFrame(std::vector<EdgeSample> samples, const std::vector<Vec3>& normals, std::vector<char> sharp,
              const std::vector<Vec3>& corners, double diagonal, const Vec3& middle, double slack);

    size_t size() const { return samples.size(); }
    // Which samples make edges in an image taken at a pose, and at which of them the part ends; hidden: whether what
    // the part itself hides is left out.
    void see(const Pose& pose, bool hidden, char* shown, char* rims) const { see(into_part(pose, {}), hidden, shown, rims); }
    // The same from where the eye is in the part's frame.
    void see(const Vec3& eye, bool hidden, char* shown, char* rims) const;

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
    bool crosses(int triangle, const Vec3& from, const Vec3& way, double reach) const;
    bool hides(const Vec3& eye, const Vec3& target, int& by) const;

    std::vector<Side> sides;  // two for each sample
    std::vector<char> sharp;
    std::vector<Vec3> lifted;
    std::vector<Triangle> triangles;
    Bvh tree;
    double slack;
};

struct Round {  // of a refinement
    double reach;  // how far edge points may be [px]
    bool asked;    // whether it is asked anew what is hidden
};

struct EdgeErrors {
    double bias, correlation;  // of whole edges, and the length over which noise is one draw [px]
};

// Robust Gauss-Newton on the offsets from a pose. The prior is information (6 x 6, lower triangle) about the first
// pose: on shifts by the part's diagonal and turns by a radian, about its middle.
Pose refined(const EdgeFrame& frame, const Lens& lens, const EdgePoints& points, const Pose& pose, const Pose& start,
             const double* prior, const std::vector<Round>& rounds, const EdgeErrors& errors);

}  // namespace tanteo
