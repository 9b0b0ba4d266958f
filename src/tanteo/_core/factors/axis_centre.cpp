// The centre of a circle: normal about the axis of a hole or boss, at any height along it, with the circle's axis (of either
// sign) and radius if they were sensed. round_centre.hpp has the formula.
#include "factors/round_centre.hpp"

namespace tanteo {

class AxisCentre final : public RoundCentre {
  public:
    static constexpr int LANDMARK = 3;
    int codimension() const override { return 2; }

  private:
    int landmark() const override { return LANDMARK; }
    bool is_line() const override { return true; }
};

static const RegisteredKind registered("axis_centre", factors_from_columns<AxisCentre>, AxisCentre::LANDMARK);

}  // namespace tanteo
