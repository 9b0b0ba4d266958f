// Casts bundles of neighbouring rays: the candidate triangles of a bundle are collected once.
#pragma once
#include <vector>

#include "shape/shape.hpp"

namespace tanteo {

class Bundle {
  public:
    explicit Bundle(const Shape& shape) : shape(shape), beside(BESIDE * shape.diagonal) {}

    // As of Shape::cast: distance and triangle, or -1.
    double cast(const Vec3& start, const Vec3& along, int* triangle) {
        double range = last >= 0 ? shape.met_at(last, start, along) : 1e300;
        if (range < length && is_beside(start, along)) {
            if (!looked) look();
            for (const int t : near) {
                const double there = shape.met_at(t, start, along);
                if (there < range) {
                    range = there;
                    last = t;
                }
            }
        } else {
            range = shape.cast(start, along, 1e300, &last, last);
            origin = start;
            direction = along;
            length = last < 0 ? 0 : range + beside;
            looked = false;
        }
        *triangle = last;
        return range;
    }

  private:
    static constexpr double BESIDE = 0.01;  // of the diagonal: wide enough for poses that are known, and few triangles

    const Shape& shape;
    const double beside;
    Vec3 origin, direction;  // of the ray beside which others are
    double length = 0;
    bool looked = false;
    int last = -1;
    std::vector<int> near;

    // Whether a ray is nowhere farther beside, up to the length: it is not at both ends.
    bool is_beside(const Vec3& start, const Vec3& along) const {
        const Vec3 off = start - origin, end = off + length * (along - direction);
        return squared(off) < beside * beside && squared(end) < beside * beside;
    }

    void look() {
        looked = true;
        near.clear();
        shape.triangles_about(origin, direction, length, beside, [&](int t) { near.push_back(t); });
    }
};

}  // namespace tanteo
