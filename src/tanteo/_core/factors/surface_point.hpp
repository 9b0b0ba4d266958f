// A sensed point of the surface, or the centre of a ball that touches it, with normal and direction if they were sensed.
#pragma once
#include "factors/on_surface.hpp"

namespace tanteo {

// p(x | pose) = integral over the surface of N(x; y + radius n(y), C) w(n(y)) dA(y): over each flat piece a normal density
// of the distance from its plane, times the mass of the noise in that plane that falls inside the piece's outline
// (truncated normal), times the density of the sensed normal. w is 1 / area for points uniform over the surface, or the
// cosine of incidence for a beam of known direction. docs/math.md, section 15.
class SurfacePoint final : public OnSurface {
  public:
    void begin(const Placement& placement, FaceQueue& queue) const override;
    void evaluate(const Placement& placement, Components& out) const override;
    int codimension() const override { return 1; }
    bool may_name(const Shape& shape, int element) const override {
        return !round_face || (element >= 0 && shape.face_round[element]);
    }
    bool aimed() const override { return directed; }

  private:
    struct Ball;
    struct Tip;
    struct Extent;
    Extent extent_of(const Placement& at) const;
    double incidence_density(const Vec3& n, const Vec3& d, double per_area) const;
    void add_face(const Placement& at, const Extent& extent, int which, FaceQueue& queue) const;
    bool add_facet_cluster(const Placement& at, const Extent& extent, const Place& place, FaceQueue& queue) const;
    bool is_minor(double weight, double size, FaceQueue& queue) const;
    void take_faces(const Placement& at, const Extent& extent, Components& out) const;
    void keep_outside(const Placement& at, size_t first, Components& out) const;
    void add_sharp(const Ball& ball, const BallContact& contact, const Vec3 across[2], const double bend[2],
                   const Vec3& slope, Components& out) const;
    void evaluate_convex_edges(const Ball& ball, Components& out) const;
    void evaluate_convex_vertices(const Ball& ball, std::vector<Tip>& tips, Components& out) const;
};

}  // namespace tanteo
