// The apex of a cone, or a point of its axis at a known offset from the apex: a normal density, with the axis into the
// cone and the half angle if they were sensed. round_centre.hpp has the formula.
#include "factors/round_centre.hpp"

namespace tanteo {

class ConeApex final : public RoundCentre {
  public:
    static constexpr int LANDMARK = 6;
    int codimension() const override { return 3; }

  private:
    int landmark() const override { return LANDMARK; }
    bool axis_is_signed() const override { return true; }
    bool size_is_angle() const override { return true; }
};

static const RegisteredKind registered("cone_apex", factors_from_columns<ConeApex>, ConeApex::LANDMARK);

}  // namespace tanteo
