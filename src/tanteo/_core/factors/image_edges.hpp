// The edges of one image as a measurement of the pose of a part.
//
// Let e be the edges of the part that are visible at the pose. A sample i of edge e represents s_i pixels of the edge. It
// is matched if an edge point of the image with the same direction lies within `reach`, at the offset d_i across the edge,
// and missed if not. If several edges match the same place of the image, the nearest one explains it, and the others count
// as neither matched nor missed. Relative to an image whose edges are random, the log density is
//
//   log L = h sum_e 1 / (1 + H_e / w) sum_{i matched} s_i / l log [q_i p(d_i) / c_i + 1 - q_i]
//         + m sum_e 1 / (1 + M_e / w) sum_{i missed} s_i / l log(1 - q_i)  +  S - S_0,
//
//   p(d) = (1 - a) N(d; 0, sigma) + a N(d; 0, sigma_a),
//   S = log sum_k a_k prod_e [(1 - g) (det C_e0 / det C_ek)^(1/2) exp((n_e - chi2_ek) / 2) + g].
//
// The first two sums depend on the presence of edges. q_i is the probability that an edge is detected (a rim of the part,
// or a crease inside its outline), c_i = chance_i / (2 reach) the density of a random edge, and a the fraction of edges
// that shadows, occluders and roundings displace. H_e and M_e are the matched and missed lengths of edge e, l is the length
// of one independent observation, and w the length beyond which more of one edge adds little: an edge is usually matched or
// missed as a whole. chance_i is the probability of an edge of texture, shadows, noise and other objects within reach, of
// the same direction and at least about the same contrast, measured around the edge point. h and m are fitted to rendered
// scenes and photographs (benchmarks/vision_fit.py, benchmarks/photographs.py; decisions 23, 38 and 87).
//
// S depends on the positions of edges. chi2_ek = d' C_ek^-1 d, with the offsets d of edge e at samples that are beside no
// other edge of the part and agree with the rest of their edge, n_e independent ones, with covariance
//
//   C_ek = W^-1 + b_k b_k',     b_ki^2 = b_i^2 + s_k^2:
//
// which adds the noise of each edge point, independent over a correlation length, and an error common to the edge (adjacent
// edges in the image, the lens) with the stated standard deviations b_i. Models and lenses may be worse than stated, for
// all edges of an image together: in case 1 every edge has a further error with the standard deviation s_1 = sigma_a / 2
// (s_0 = 0). The cases have the probabilities a_0 = 1 - a_1 and a_1. Through the determinants, edges with the stated errors
// prefer case 0: det C_ek = det W^-1 (1 + b_k' W b_k). With a further case of sigma_a, poses some pixels off would be too
// probable (tests/planning/execution/test_seen.py). An edge of another object has the density g, relative to that of the
// part's edges with usual noise in case 0. Slope and Gauss-Newton information of S are the means over the cases, weighted
// by their probabilities at the state. S_0 is a constant about each pose that the image suggests. It makes the integral of
// the density there equal to that of the first two sums: the positions of edges inform the pose and not the identity,
// because edges are more exact than models of parts and of light (decision 87). Farther from these poses, S_0 is at least
// the S of edges that all come from other objects: there the image carries no information on the pose.
//
// The offsets d are those of the edge points less their biases m_i = c t_i + (1/2 + z_r / 2) r_i. t_i is the displacement of
// the point in a coarser image: shading beside an edge displaces it by the variance of all blur, and c extrapolates to none.
// The lens blurs light, and the response curve of the camera then moves the edge to the dark side, by r_i for the curve of
// sRGB, by nothing for a linear camera.
//
// Shared errors: the camera's pose, T_world_camera exp(S z + M y) with S S' its covariance in this image and M M' that of its
// mounting, whose errors y are the same in all images of the mounting; a shift of all edges in the image; and the response
// curve z_r.
#pragma once
#include <algorithm>
#include <memory>
#include <array>
#include <vector>

#include "image/image_frame.hpp"
#include "solve/pose_term.hpp"

namespace tanteo {

// The image: its edge points, the density of random edges, and the camera.
struct EdgeImage {
    Lens lens;
    Pose T_world_camera;
    std::vector<double> camera_root;  // 36, row-major: S; empty if the camera's pose is exact
    std::vector<double> mount_root;   // 36, row-major: M; empty if the camera has no mounting in common with other images
    double shift_sd = 0;              // common shift of all edges along each axis [px]; 0: no state
    int64_t rows = 0, columns = 0, channels = 0;
    std::vector<int32_t> nearest;     // channels x rows x columns: the nearest edge point of a direction; -1 for none
    std::vector<double> pixels, sds, commons, widths;  // edge points n x 2; their noise, the error common to their edge, and their blur, each n [px]
    std::vector<double> normals, drifts, responses;  // unit normals n x 2; c t_i and r_i along them, each n [px]
    double blur = 0;                  // blur whose effect on a bend the drifts include [px]
    bool has_response = false;        // whether any r_i is not zero
    std::vector<float> chance;        // of each edge point, or one value for all

    int camera_states() const { return camera_root.empty() ? 0 : 6; }
    int shift_states() const { return shift_sd > 0 ? 2 : 0; }
    int states() const { return camera_states() + shift_states() + has_response; }
    int mount_states() const { return mount_root.empty() ? 0 : 6; }
};

struct EdgeRules {
    double stretch, whole;                // l, w [px]
    double rim_seen, crease_seen;         // q
    double reach;                         // [px], of the chance density
    double spread, displaced, displaced_sd;  // sigma, a, sigma_a [px]
    double hits, misses;                  // h, m
    double beside, along;                 // samples match one place within this distance [px] and cosine of their normals
    double most_pulled;                   // largest correction of the displacement of an edge by blur [px]
    double correlation;                   // length over which the noise of edge points is one draw [px]
    double astray;                        // g; 0 omits S
    double near;                          // motion up to which S_0 of a pose applies, over the spread of the part's marks
    double inexact;                       // a_1
};

// S_0 of all poses that are nearest to this pose.
struct PoseLevel {
    Pose T_world_part;
    double level;
};

// Geometry of the part that the image model uses.
struct EdgePart {
    std::shared_ptr<const EdgeFrame> frame;
    std::vector<int> groups;       // index of the edge or rim of each sample, from 0
    std::vector<Vec3> bends;       // vector from a sample to the centre of its rim over the squared radius [1/m]; or zero
    std::vector<Vec3> marks;       // points that every motion moves, except the symmetries of the part
    int edges = 0;
};

class ImageEdges : public PoseTerm {
  public:
    // first: index in z of the first shared error of the image; common: of the first error of its mounting; reach: largest
    // distance of a matched edge point [px]; levels: S_0 is 0 if there are none.
    ImageEdges(std::shared_ptr<const EdgePart> part, std::shared_ptr<const EdgeImage> image, const EdgeRules& rules,
               std::vector<PoseLevel> levels, double reach, int first, int common);

    double add(const State& state, const Slope* slope) const override;
    int columns() const override {
        return std::max(first + image->states(), image->mount_states() ? common + image->mount_states() : 0);
    }

    // The sums of the log density at a state.
    struct Sums {
        double log = 0, there = 0;  // log density, and its part that depends on the presence of edges
        double hits = 0, misses = 0;  // before h and m
        double located = 0;          // S
        double astray = 0;           // S if all edges come from other objects
        double chi2 = 0, draws = 0;  // chi-square of the offsets of the part's own edges, and the number of independent offsets
        double squares = 0, matched = 0;  // sum of squared offsets [px^2], and their number
    };
    Sums sums(const State& state) const { return evaluate(state, nullptr); }

  private:
    struct Sample;
    Sums evaluate(const State& state, const Slope* slope) const;
    void locate(const std::vector<Sample>& all, const std::vector<char>& clear, Sums& sums, const Slope* slope,
                const int* columns, int count) const;
    double level_at(const Pose& T_world_part, double least) const;

    std::shared_ptr<const EdgePart> part;
    std::shared_ptr<const EdgeImage> image;
    EdgeRules rules;
    std::vector<PoseLevel> levels;
    double reach;
    int first, common;
    EdgePoints points;
};

}  // namespace tanteo
