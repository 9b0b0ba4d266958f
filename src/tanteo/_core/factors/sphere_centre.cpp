// The centre of a sphere: normal about the centre of a ball or socket, with its radius if it was sensed.
// round_centre.hpp has the formula.
#include "factors/round_centre.hpp"

namespace tanteo {

class SphereCentre final : public RoundCentre {
  public:
    static constexpr int LANDMARK = 5;
    int codimension() const override { return 3; }

  private:
    int landmark() const override { return LANDMARK; }
    bool axis_is_signed() const override { return true; }  // a sphere has no axis; a stated one is compared with its sign
};

static const RegisteredKind registered("sphere_centre", factors_from_columns<SphereCentre>, SphereCentre::LANDMARK);

}  // namespace tanteo
