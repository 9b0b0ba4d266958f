// The edges of one image as a measurement of the pose of a part.
//
// Let e be the edges of the part that the camera sees at the pose. A sample i of edge e stands for s_i pixels of it. It
// is met if an edge point of the image of the same direction lies within `reach`, at the offset d_i across the edge, and
// missed if not. Of edges that meet the same place of the image the nearest explains it; the others count as neither.
// Relative to an image in which edges come by chance, the log density is
//
//   log L = h sum_e 1 / (1 + H_e / w) sum_{i met} s_i / l log [q_i p(d_i) / c_i + 1 - q_i]
//         + m sum_e 1 / (1 + M_e / w) sum_{i missed} s_i / l log(1 - q_i)  +  b B / l^2  +  S - S_0,
//
//   p(d) = (1 - a) N(d; 0, sigma) + a N(d; 0, sigma_a),
//   S = log sum_k a_k prod_e [(1 - g) (det C_e0 / det C_ek)^(1/2) exp((n_e - chi2_ek) / 2) + g].
//
// The first three sums say that edges are there. q_i is the probability that an edge shows (a rim of the part, a crease
// inside of it), c_i = chance_i / (2 reach) the density of an edge by chance, and a the share of edges that shadows,
// occluders and roundings displace. H_e and M_e are the lengths of edge e that are met and missed, l is the length of one
// observation, and w the length from which more of one edge adds little: an edge is met or missed as a whole. B is the
// area [px^2] of the part's silhouette that lies where the image shows bare table. h, m and b are fitted to rendered
// scenes (benchmarks/vision_fit.py; decisions 23, 38 and 87).
//
// S says where they are. chi2_ek = d' C_ek^-1 d is that of the offsets d of edge e, of samples that no other edge of the part is
// beside and that run with the rest of their edge, n_e independent ones, with covariance
//
//   C_ek = W^-1 + b_k b_k',     b_ki^2 = b_i^2 + s_k^2:
//
// noise of each edge point, independent over a correlation length, and an error that is common to the edge (its neighbours
// in the image, the lens) with the standard deviations b_i that are stated. Models and lenses may be worse than stated, for
// all edges of an image alike: in case 1 every edge has an error of its own more, with the standard deviation s_1 = sigma_a / 2
// (s_0 = 0). The cases have the probabilities a_0 = 1 - a_1 and a_1. The determinants make edges that are as stated prefer
// case 0: det C_ek = det W^-1 (1 + b_k' W b_k). With a case of sigma_a, too, poses some pixels off are too probable
// (tests/planning/execution/test_seen.py). An edge that is another's has the density g,
// relative to that of the part's own with usual noise in case 0. The slope of S is the mean over the cases of their slopes,
// by their probabilities at the state, and so is its Gauss-Newton information. S_0, a constant about each pose that the image
// suggests, makes the integral of the whole there that of the first three sums at that pose: the places of
// edges inform the pose and not the identity, because edges are more exact than models of parts and of light (decision 87).
// Farther from these poses S_0 is S of edges that are all another's, at least: there the image says nothing of the pose.
//
// Shared errors: the camera's pose, T_world_camera exp(S z) with S S' its covariance, and a shift of all edges in the image.
#pragma once
#include <map>
#include <memory>
#include <mutex>
#include <array>
#include <vector>

#include "image/image_frame.hpp"
#include "solve/pose_term.hpp"

namespace tanteo {

// The image: where its edge points are, how often one is met by chance, where bare table is seen, and the camera.
struct EdgeImage {
    Lens lens;
    Pose T_world_camera;
    std::vector<double> camera_root;  // 36, row-major: S; empty where the camera's pose is exact
    double shift_sd = 0;              // of all edges together along each axis [px]; 0: no state
    int64_t rows = 0, columns = 0, channels = 0;
    std::vector<int32_t> nearest;     // channels x rows x columns: the nearest edge point of a direction; -1 for none
    std::vector<double> pixels, sds, commons, widths;  // of the edge points: n x 2, n, error common to an edge n, blur n [px]
    std::vector<float> chance;        // channels x rows x columns, or one value for all
    std::vector<char> bare;           // rows x columns; empty where bare table is not known

    int camera_states() const { return camera_root.empty() ? 0 : 6; }
    int states() const { return camera_states() + (shift_sd > 0 ? 2 : 0); }
};

struct EdgeRules {
    double stretch, whole;                // l, w [px]
    double rim_seen, crease_seen;         // q
    double reach;                         // [px], of the chance density
    double spread, displaced, displaced_sd;  // sigma, a, sigma_a [px]
    double hits, misses, spilled;         // h, m, b
    double beside, along;                 // samples meet one place within this [px] and this cosine of their normals
    double most_pulled;                   // the displacement of a blurred rim is corrected up to this [px]
    double correlation;                   // noise of edge points is one draw over this length [px]
    double astray;                        // g; 0 leaves S out
    double near;                          // S_0 is that of a pose up to this motion, over the spread of the part's marks
    double inexact;                       // a_1
};

// S_0 of poses that are nearest to this one.
struct PoseLevel {
    Pose T_world_part;
    double level;
};

// The part as the camera may see it.
struct EdgePart {
    std::shared_ptr<const EdgeFrame> frame;
    std::vector<int> groups;       // edge or rim of the part that each sample belongs to, from 0
    std::vector<Vec3> bends;       // from a sample to the middle of its rim, over the square of the radius [1/m]; or zero
    std::vector<Vec3> cover, cover_normals;  // places all over the surface
    double cover_area = 0;         // of the surface that each stands for [m^2]
    std::vector<Vec3> marks;       // points that every motion moves, unless it is a turn that maps the part onto itself
    int edges = 0;
};

class ImageEdges : public PoseTerm {
  public:
    // `first`: where the shared errors of the image begin in z; `reach`: how far an edge point may be [px]; `levels`: S_0
    // is 0 where there are none.
    ImageEdges(std::shared_ptr<const EdgePart> part, std::shared_ptr<const EdgeImage> image, const EdgeRules& rules,
               std::vector<PoseLevel> levels, double reach, int first);

    double add(const State& state, const Slope* slope) const override;
    int columns() const override { return first + image->states(); }

    // The sums behind the density at a state.
    struct Sums {
        double log = 0, there = 0;  // log density, and that part of it that says that edges are there
        double hits = 0, misses = 0, spilled = 0;  // before h, m and b; spilled in [px^2]
        double located = 0;          // S
        double astray = 0;           // S if all edges are another's
        double chi2 = 0, draws = 0;  // of the offsets of edges that are the part's own, and how many independent ones
        double squares = 0, met = 0;  // of all offsets [px^2], and how many there are
    };
    Sums sums(const State& state) const { return evaluate(state, nullptr); }

  private:
    struct View {
        std::vector<char> shown, rims;
    };
    struct Met;
    Sums evaluate(const State& state, const Slope* slope) const;
    void locate(const std::vector<Met>& met, const std::vector<char>& clear, Sums& sums, const Slope* slope,
                const int* columns, int count) const;
    std::shared_ptr<const View> view_from(const Vec3& eye) const;
    double spilled_area(const Pose& pose, const Lens& lens) const;
    double level_at(const Pose& T_world_part, double least) const;

    std::shared_ptr<const EdgePart> part;
    std::shared_ptr<const EdgeImage> image;
    EdgeRules rules;
    std::vector<PoseLevel> levels;
    double reach;
    int first;
    EdgePoints points;
    mutable std::mutex mutex;
    mutable std::map<std::array<int64_t, 4>, std::shared_ptr<const View>> views;
};

}  // namespace tanteo
