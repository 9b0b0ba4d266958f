// A point that was sensed on a straight edge of the part: normal about the edge, uniform along it. The probability of an
// edge is proportional to its length: p(x | pose) = sum_i (L_i / L) f_i(x), with f_i of gaussian.hpp.
#include <algorithm>

#include "factors/gaussian.hpp"
#include "factors/on_surface.hpp"

namespace tanteo {

class EdgePoint final : public OnSurface {
  public:
    int codimension() const override { return 2; }
    void evaluate(const Placement& at, Components& out) const override {
        const Shape& shape = at.shape;
        const size_t first = out.size();
        for (size_t k = 0; k < shape.edges.size(); ++k) {
            const Segment& e = shape.edges[k];
            Component c;
            c.weight = segment_density(e.a, e.direction, e.length, at.p, at.C, c) * e.length / shape.edge_length *
                       fast_exp(-log_outlier);
            if (!(c.weight >= at.negligible)) continue;
            c.element = -2 - static_cast<int>(k);
            out.all.push_back(c);
        }
        if (out.size() > first && is_blocked(at)) out.all.resize(first);
    }
};

static const RegisteredKind registered("edge_point", factors_from_columns<EdgePoint>);

}  // namespace tanteo
