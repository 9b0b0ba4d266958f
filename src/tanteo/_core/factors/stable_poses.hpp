// The prior density of the pose of a part that lies on a table in one of its stable poses.
//
// With the table's normal u in the part frame, and the height h of the part's centroid over the table, a stable pose r has
// the normal u_r and height h_r. Position and yaw on the table are uniform:
//
//   p(T) = 1 / (2 pi A) sum_r p_r N(h; h_r, sigma_h^2) N_2(tilt between u and u_r; 0, sigma_t^2),
//
// over shifts [m] and turns [rad], with the area A [m^2] in which the part lies. A part of revolution on its side has the
// same stable pose for all u at one angle to its axis: the tilt has one direction, and the density is spread over that
// circle. A ball has no tilt.
#pragma once
#include <vector>

#include "solve/pose_term.hpp"

namespace tanteo {

struct StablePose {
    Vec3 up;             // the table's normal in the part's frame, unit
    double height;       // of the centroid [m]
    double log_weight;
};

class StablePoses : public PoseTerm {
  public:
    enum class Freedom { NONE = 0, AXIS = 1, ALL = 2 };  // turns that map the part onto itself

    StablePoses(std::vector<StablePose> poses, const Vec3& centroid, Freedom freedom, const Vec3& axis, const Pose& T_world_table,
                double height_sd, double tilt_sd, double area);

    double add(const State& state, const Slope* slope) const override;

  private:
    std::vector<StablePose> poses;
    Vec3 centroid;
    Freedom freedom;
    Vec3 axis;
    Vec3 point, normal;  // of the table, in the world
    double height_sd, tilt_sd, log_place;
};

}  // namespace tanteo
