// Python bindings of the additional terms of the log density: edges of an image, stable poses on a table, normal
// densities of the pose, and alternatives of such terms.
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <memory>

#include "bindings/image_arguments.hpp"
#include "parallel.hpp"
#include "factors/alternatives.hpp"
#include "factors/image_edges.hpp"
#include "factors/normal_poses.hpp"
#include "bindings/normal_poses_arguments.hpp"
#include "factors/stable_poses.hpp"

namespace tanteo {

namespace {

using namespace nb::literals;

std::shared_ptr<EdgeImage> make_edge_image(Doubles camera, Doubles T_world_camera, Doubles camera_root,
                                           Doubles mount_root, double shift_sd, Ints nearest, Doubles pixels, Doubles sds, Doubles commons, Doubles widths,
                                           Doubles normals, Doubles drifts, Doubles responses, double blur, Floats chance) {
    auto image = std::make_shared<EdgeImage>();
    image->lens = lens_of(camera);
    expect(T_world_camera, "T_world_camera", {4, 4});
    if (T_world_camera.size() == 0) refuse("T_world_camera", "expected one pose");
    image->T_world_camera = load_pose(T_world_camera.data());
    if (camera_root.size()) image->camera_root = doubles(camera_root, "camera_root", {6, 6});
    if (mount_root.size()) image->mount_root = doubles(mount_root, "mount_root", {6, 6});
    image->shift_sd = expect(shift_sd, "shift_sd", 0, 1e3);
    if (nearest.ndim() != 3 || nearest.size() == 0) refuse("nearest", "expected channels x rows x columns");
    image->channels = static_cast<int64_t>(nearest.shape(0));
    image->rows = static_cast<int64_t>(nearest.shape(1));
    image->columns = static_cast<int64_t>(nearest.shape(2));
    image->nearest.assign(nearest.data(), nearest.data() + nearest.size());
    const size_t count = expect(pixels, "pixels", {ANY, 2});
    image->pixels.assign(pixels.data(), pixels.data() + pixels.size());
    image->sds = doubles(sds, "sds", {count});
    image->commons = doubles(commons, "commons", {count});
    image->widths = doubles(widths, "widths", {count});
    expect(normals, "normals", {count, 2});
    image->normals.assign(normals.data(), normals.data() + normals.size());
    image->drifts = doubles(drifts, "drifts", {count});
    image->responses = doubles(responses, "responses", {count});
    image->blur = expect(blur, "blur", 0, 1e3);
    for (const double value : image->responses) image->has_response |= value != 0;
    for (const double sd : image->sds)
        if (!(sd > 0)) refuse("sds", "expected standard deviations above zero");
    if (chance.size() != 1 && chance.size() != count) refuse("chance", "expected one value, or one for each edge point");
    image->chance.assign(chance.data(), chance.data() + chance.size());
    for (const float value : image->chance)
        if (!(value > 0 && value <= 1)) refuse("chance", "expected probabilities above zero");
    return image;
}

std::shared_ptr<EdgePart> make_edge_part(std::shared_ptr<EdgeFrame> frame, Ints groups, Doubles bends, Doubles marks) {
    auto part = std::make_shared<EdgePart>();
    part->groups = expect(groups, "groups", frame->size(), 0, int64_t(frame->size()));
    part->bends = vectors(bends, "bends");
    if (part->bends.size() != frame->size()) refuse("bends", "expected one for each sample");
    part->marks = vectors(marks, "marks");
    for (const int group : part->groups) part->edges = std::max(part->edges, group + 1);
    part->frame = std::move(frame);
    return part;
}

std::shared_ptr<ImageEdges> image_edges(std::shared_ptr<EdgePart> part, std::shared_ptr<EdgeImage> image, Doubles rules,
                                        Doubles level_poses, Doubles levels, double reach, int first, int common) {
    expect(rules, "rules", {17});
    if (rules.size() == 0) refuse("rules", "expected 17 numbers");
    const double* r = rules.data();
    const EdgeRules all{r[0], r[1],  r[2],  r[3],  r[4],  r[5],  r[6],  r[7], r[8],
                        r[9], r[10], r[11], r[12], r[13], r[14], r[15], r[16]};
    for (const int k : {0, 1, 4, 5, 7, 13, 15}) expect(r[k], "rules", 1e-9, 1e9);
    for (const int k : {2, 3, 6, 14, 16}) expect(r[k], "rules, probabilities", 0, 1 - 1e-12);
    const std::vector<Pose> at = poses(level_poses, "level_poses");
    expect(levels, "levels", {at.size()});
    std::vector<PoseLevel> known;
    for (size_t k = 0; k < at.size(); ++k) known.push_back({at[k], levels.data()[k]});
    return std::make_shared<ImageEdges>(std::move(part), std::move(image), all, std::move(known), expect(reach, "reach", 1e-9, 1e9),
                                        static_cast<int>(expect(first, "first", 0, 1e3)), static_cast<int>(expect(common, "common", 0, 1e3)));
}

// The sums of the log density of an image at states, one row each: log density, its part by the presence of edges, hits,
// misses, log density by the positions of edges, chi-square of offsets, number of independent offsets,
// squares of offsets [px^2], matched samples.
Out image_sums(const ImageEdges& term, Doubles Ts, Doubles shared) {
    const std::vector<Pose> all = poses(Ts);
    const size_t D = shared.ndim() == 2 ? shared.shape(1) : 0;
    expect(shared, "shared", {all.size(), D});
    if (D < static_cast<size_t>(term.columns())) refuse("shared", "expected the shared errors of the image");
    std::vector<double> out(9 * all.size());
    {
        nb::gil_scoped_release release;
        for_all(all.size(), [&] {
            return [&](size_t k) {
                const double* z = shared.data() + D * k;
                const ImageEdges::Sums s = term.sums({all[k], std::vector<double>(z, z + D)});
                const double values[9] = {s.log,  s.there, s.hits,    s.misses, s.located,
                                         s.chi2, s.draws, s.squares, s.matched};
                std::copy(values, values + 9, &out[9 * k]);
            };
        });
    }
    return array_of(std::move(out), {all.size(), 9});
}

std::shared_ptr<StablePoses> stable_poses(Doubles ups, Doubles heights, Doubles log_weights, Doubles centroid, int freedom,
                                          Doubles axis, Doubles T_world_table, double height_sd, double tilt_sd,
                                          double area) {
    const std::vector<Vec3> all = vectors(ups, "ups");
    if (all.empty()) refuse("ups", "expected one stable pose at least");
    expect(heights, "heights", {all.size()});
    expect(log_weights, "log_weights", {all.size()});
    expect(T_world_table, "T_world_table", {4, 4});
    if (T_world_table.size() == 0) refuse("T_world_table", "expected one pose");
    std::vector<StablePose> stable;
    for (size_t k = 0; k < all.size(); ++k) stable.push_back({unit(all[k]), heights.data()[k], log_weights.data()[k]});
    const int kind = static_cast<int>(expect(freedom, "freedom", 0, 2));
    return std::make_shared<StablePoses>(std::move(stable), vector(centroid, "centroid"),
                                         static_cast<StablePoses::Freedom>(kind), vector(axis, "axis"),
                                         load_pose(T_world_table.data()), expect(height_sd, "height_sd", 1e-12, 1e12),
                                         expect(tilt_sd, "tilt_sd", 1e-12, 1e12), expect(area, "area", 1e-18, 1e18));
}

std::shared_ptr<NormalPoses> normal_poses(Doubles means, Doubles roots, Doubles log_weights) {
    return std::make_shared<NormalPoses>(pose_priors(means, roots, log_weights));
}

std::shared_ptr<Alternatives> alternatives(std::vector<std::vector<std::shared_ptr<PoseTerm>>> groups, Doubles log_weights) {
    if (groups.empty()) refuse("groups", "expected one group of terms at least");
    expect(log_weights, "log_weights", {groups.size()});
    std::vector<TermGroup> all;
    for (size_t k = 0; k < groups.size(); ++k)
        all.push_back({log_weights.data()[k], {groups[k].begin(), groups[k].end()}});
    return std::make_shared<Alternatives>(std::move(all));
}

// The log density of a term at states, its gradient and its information about a centre.
nb::tuple term_slopes(const PoseTerm& term, Doubles Ts, Doubles shared, Doubles centre) {
    const std::vector<Pose> all = poses(Ts);
    const size_t D = shared.ndim() == 2 ? shared.shape(1) : 0, K = 6 + D, B = all.size();
    expect(shared, "shared", {B, D});
    if (D < static_cast<size_t>(term.columns())) refuse("shared", "expected the shared errors of the term");
    const Vec3 about = vector(centre, "centre");
    std::vector<double> log(B), gradient(B * K), information(B * K * K);
    {
        nb::gil_scoped_release release;
        for (size_t k = 0; k < B; ++k) {
            const double* z = shared.data() + D * k;
            double* A = &information[k * K * K];
            const Slope slope{about, static_cast<int>(K), &gradient[k * K], A};
            log[k] = term.add({all[k], std::vector<double>(z, z + D)}, &slope);
            for (size_t a = 0; a < K; ++a)
                for (size_t b = 0; b < a; ++b) A[b * K + a] = A[a * K + b];
        }
    }
    return nb::make_tuple(array_of(std::move(log), {B}), array_of(std::move(gradient), {B, K}),
                          array_of(std::move(information), {B, K, K}));
}

}  // namespace

void offer_pose_terms(nb::module_& m) {
    nb::class_<EdgeImage>(m, "EdgeImage").def_prop_ro("states", &EdgeImage::states);
    nb::class_<EdgePart>(m, "EdgePart");
    nb::class_<ImageEdges, PoseTerm>(m, "ImageEdges");
    nb::class_<StablePoses, PoseTerm>(m, "StablePoses");
    nb::class_<NormalPoses, PoseTerm>(m, "NormalPoses");
    nb::class_<Alternatives, PoseTerm>(m, "Alternatives");
    m.def("make_edge_image", &make_edge_image, "camera"_a, "T_world_camera"_a, "camera_root"_a, "mount_root"_a, "shift_sd"_a, "nearest"_a,
          "pixels"_a, "sds"_a, "commons"_a, "widths"_a, "normals"_a, "drifts"_a, "responses"_a, "blur"_a, "chance"_a);
    m.def("make_edge_part", &make_edge_part, "frame"_a, "groups"_a, "bends"_a, "marks"_a);
    m.def("image_edges", &image_edges, "part"_a, "image"_a, "rules"_a, "level_poses"_a, "levels"_a,
          "reach"_a, "first"_a, "common"_a);
    m.def("image_sums", &image_sums, "term"_a, "poses"_a, "shared"_a);
    m.def("stable_poses", &stable_poses, "ups"_a, "heights"_a, "log_weights"_a, "centroid"_a, "freedom"_a, "axis"_a,
          "T_world_table"_a, "height_sd"_a, "tilt_sd"_a, "area"_a);
    m.def("normal_poses", &normal_poses, "means"_a, "roots"_a, "log_weights"_a);
    m.def("alternatives", &alternatives, "groups"_a, "log_weights"_a);
    m.def("term_slopes", &term_slopes, "term"_a, "poses"_a, "shared"_a, "centre"_a);
}

}  // namespace tanteo
