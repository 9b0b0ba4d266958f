// A point that was sensed on a corner of the part: a normal density about each corner, all equally probable.
// p(x | pose) = sum_i N(x; c_i, C) / n.
#include "factors/gaussian.hpp"
#include "factors/on_surface.hpp"

namespace tanteo {

class CornerPoint final : public OnSurface {
  public:
    int codimension() const override { return 3; }
    void evaluate(const Placement& at, Components& out) const override {
        const Shape& shape = at.shape;
        const size_t first = out.size();
        const PointDensity density(at.C);
        for (size_t k = 0; k < shape.corners.size(); ++k) {
            Component c;
            c.weight = density.at(shape.corners[k], at.p, c) * fast_exp(-log_outlier) / shape.corners.size();
            if (!(c.weight >= at.negligible)) continue;
            c.element = -2 - static_cast<int>(shape.edges.size() + k);
            out.all.push_back(c);
        }
        if (out.size() > first && is_blocked(at)) out.all.resize(first);
    }
};

static const RegisteredKind registered("corner_point", factors_from_columns<CornerPoint>);

}  // namespace tanteo
