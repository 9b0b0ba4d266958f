// The centre of a torus: normal about the centre of a toroidal face (a ring, a groove for a seal, a rounded rim), with its
// axis of either sign and its two radii if they were sensed. round_centre.hpp has the formula.
#include "factors/round_centre.hpp"

namespace tanteo {

class TorusCentre final : public RoundCentre {
  public:
    static constexpr int LANDMARK = 7;
    int codimension() const override { return 3; }

  private:
    int landmark() const override { return LANDMARK; }
};

static const RegisteredKind registered("torus_centre", factors_from_columns<TorusCentre>, TorusCentre::LANDMARK);

}  // namespace tanteo
