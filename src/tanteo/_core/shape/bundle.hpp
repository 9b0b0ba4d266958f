// Casts bundles of adjacent rays: the candidate triangles of a bundle are collected once.
#pragma once
#include <vector>

#include "shape/shape.hpp"

namespace tanteo {

class Bundle {
  public:
    explicit Bundle(const Shape& shape) : shape(shape), beside(BESIDE * shape.diagonal) {}

    // Returns the distance of the first hit, and its triangle or -1, as Shape::cast does.
    double cast(const Vec3& start, const Vec3& along, int* triangle) {
        double range = last >= 0 ? shape.hit_at(last, start, along) : 1e300;
        if (range < length && is_beside(start, along)) {
            if (!collected) collect();
            for (const int t : near) {
                const double there = shape.hit_at(t, start, along);
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
            collected = false;
        }
        *triangle = last;
        return range;
    }

  private:
    static constexpr double BESIDE = 0.01;  // radius of a bundle over the diagonal: wide enough for precise poses, with few triangles

    const Shape& shape;
    const double beside;
    Vec3 origin, direction;  // central ray of the bundle
    double length = 0;
    bool collected = false;
    int last = -1;
    std::vector<int> near;

    // Whether a ray is within the bundle up to its length: it is at both ends.
    bool is_beside(const Vec3& start, const Vec3& along) const {
        const Vec3 off = start - origin, end = off + length * (along - direction);
        return squared(off) < beside * beside && squared(end) < beside * beside;
    }

    void collect() {
        collected = true;
        near.clear();
        shape.triangles_about(origin, direction, length, beside, [&](int t) { near.push_back(t); });
    }
};

}  // namespace tanteo
