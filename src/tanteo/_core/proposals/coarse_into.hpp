// Transformation of points to the part frame, in steps of its field from the first node.
#pragma once
#include "proposals/coarse.hpp"

namespace tanteo {

struct CoarseInto {
    float m[9], o[3];
    CoarseInto(const CoarseField& field, const CoarseView& view) {
        const double per = 1 / field.step;
        const Vec3 from = per * (view.at - field.origin);
        for (int i = 0; i < 9; ++i) m[i] = static_cast<float>(per * view.into.m[i]);
        for (int k = 0; k < 3; ++k) o[k] = static_cast<float>(from[k]);
    }
};

inline void place(const CoarseInto& to, const CoarseBlock& b, float* x, float* y, float* z) {
    const float* m = to.m;
    for (int l = 0; l < LANES; ++l) {
        x[l] = m[0] * b.x[l] + m[1] * b.y[l] + m[2] * b.z[l] + to.o[0];
        y[l] = m[3] * b.x[l] + m[4] * b.y[l] + m[5] * b.z[l] + to.o[1];
        z[l] = m[6] * b.x[l] + m[7] * b.y[l] + m[8] * b.z[l] + to.o[2];
    }
}

}  // namespace tanteo
