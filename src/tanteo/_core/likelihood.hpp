// The log density of everything that was sensed, given a pose of the part, the shared errors and the noise scale.
#pragma once
#include <algorithm>
#include <vector>

#include "problem.hpp"
#include "shape.hpp"

namespace tanteo {

constexpr int MOST_STATES = 64;

// One face, edge or corner that a point may have met.
struct Hit {
    double weight;  // density over that of an outlier
    double distance, per_sd;
    Vec3 normal;
    Vec3 slope;  // gradient of the log of the share by the point
    Mat3 stiff;  // minus the second derivative of that, and the information on the point itself for edges and corners
    double spread = 0;  // derivative of the log of the share by the log of the noise
    int face, tilted;
    double tilt[2], per_tilt[2], bend[2], along;  // sensed normal against the surface's
    Vec3 e[2];
};

struct BallSees {  // what a ball touches, or is inside of: a flat, or an edge or a vertex (-1)
    int flat, face;
    bool round;
    Vec3 normal, on_it;
    double gap, share;
};

struct Ball {  // a touch with a ball, in the part: the sensor came along a direction and may have felt a normal
    const Point& point;
    Vec3 centre, along, felt;
    Mat3 C;
    double per_sd, normal_variance;
};

struct Tip {  // a convex vertex that a ball may touch, with one of its edges
    int vertex, face;
    Vec3 at, away;
};

struct Seen {  // a point at a pose
    Vec3 in_part;
    int first = 0, count = 0;
    double density = 0;  // of the part, over that of an outlier
    double belongs = 0;
};

struct GroupView {  // points of one label at a pose
    std::vector<int> faces;
    std::vector<double> log_prior, factor, on_face, logs, weights;
};

class Likelihood {
  public:
    Likelihood(const Shape& shape, const Problem& problem) : shape(shape), problem(problem) {}

    // log density, prior included; with_slope: also gradient and Gauss-Newton information, of size() states,
    // about the centre of the shape
    double at(const State& state, bool with_slope);

    std::vector<char> coarse;        // whether a point counts where noise is blurred; empty: all do
    double blur = 0, blur_turn = 0;  // added to the noise of points [m] and normals [rad]: coarse to fine
    std::vector<double> gradient, information;
    double log_points = 0;  // of the points alone
    std::vector<double> of_points;  // their share of the information, where the noise scale is a state
    double scaled_share = 0;        // of their variance, which the scale scales
    std::vector<Seen> seen;
    std::vector<Hit> hits;
    std::vector<BallSees> ball_sees, faces_near;  // of one ball: by hit, and all flats

    // of a group if what it names is of the part, over that of as many outliers; after at()
    double log_on_part(size_t g) { return log_group(g, false); }

  private:
    const Shape& shape;
    const Problem& problem;
    std::vector<double> node_log, hit_share;
    std::vector<int> order;  // of the hits of a point
    std::vector<GroupView> views;

    void look(const State& state, int j, bool with_slope);
    void look_at_faces(const Point& point, int j, const Mat3& R, const Mat3& C, bool with_slope);
    bool meet_place(const Point& point, const Vec3& p, const Vec3& d, const Mat3& C, double reach, double sd, int first,
                    const Place& place);
    bool left_out(int j) const { return blur > 0 && !coarse.empty() && !coarse[j]; }
    void keep_outside(size_t first);
    void meet_sharp(const Ball& ball, const BallSees& sees, const Vec3 across[2], const double bend[2], const Vec3& slope);
    void look_over_edges(const Ball& ball);
    void look_over_vertices(const Ball& ball, std::vector<Tip>& tips);
    void look_at_edges(const Point& point, int j, const Mat3& C);
    void look_at_corners(const Point& point, int j, const Mat3& C);
    void look_at_axes(const Point& point, int j, const Mat3& R, const Mat3& C);
    bool blocked(const Point& point, const Vec3& p, const Vec3& d, double sd) const;
    // whether a label of that kind may name the face
    bool may_be_of(const Point& point, int face) const {
        return point.kind != Kind::ROUND || (face >= 0 && shape.face_round[face]);
    }
    double combine();
    void view_group(size_t g);
    double log_group(size_t g, bool anywhere = true);
    double labelled_density(const GroupView& view, size_t r, size_t f, int row) const;
    void share_group(size_t g);
    void share_hits(size_t g);
    void add_points(const State& state);
    double add_rays(const State& state);
    double add_priors(const State& state, bool with_slope);
    double add_pose_prior(const Pose& pose, bool with_slope);
    double add_table(const Pose& pose, bool with_slope);
    void add_residuals(double share, const double* r, const double* rows, int count);
};

}  // namespace tanteo
