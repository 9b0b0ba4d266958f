// A log density that a Python function computes for a batch of poses: a sensor of a user, without a compiler.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "bindings/conversion.hpp"
#include "solve/pose_term.hpp"
#include "solve/symmetric.hpp"

namespace tanteo {

namespace {

using namespace nb::literals;

// log[(1 - q) exp(l(T)) + q], with l the user's log density over that of an outlier and q the outlier rate. Derivatives of
// l by small motions T exp(xi) about the centre of the part are the user's, or central differences; the information is
// minus the second derivative without its negative part.
class PythonTerm final : public PoseTerm {
  public:
    PythonTerm(std::string name, nb::callable log_density, std::optional<nb::callable> gradient, double shift, double turn,
               double outlier_rate)
        : name(std::move(name)), log_density(std::move(log_density)), gradient(std::move(gradient)), shift(shift),
          turn(turn), outlier_rate(outlier_rate) {}
    ~PythonTerm() override {  // the last owner may be a thread without the interpreter's lock
        nb::gil_scoped_acquire lock;
        log_density.reset();
        gradient.reset();
    }

    double add(const State& state, const Slope* slope) const override {
        nb::gil_scoped_acquire lock;
        if (!slope) return mixed(values({state.pose})[0], nullptr);
        double g[6], H[36];
        const double log = gradient ? from_gradients(state.pose, slope->centre, g, H)
                                    : from_values(state.pose, slope->centre, g, H);
        double inlier;
        const double out = mixed(log, &inlier);
        const std::vector<double> information = not_negative_part(H);
        for (int a = 0; a < 6; ++a) {
            slope->gradient[a] += inlier * g[a];
            for (int b = 0; b <= a; ++b) slope->information[a * slope->size + b] += inlier * information[6 * a + b];
        }
        return out;
    }

    std::vector<double> values(const std::vector<State>& states) const override {
        nb::gil_scoped_acquire lock;
        std::vector<Pose> poses;
        for (const State& state : states) poses.push_back(state.pose);
        std::vector<double> out = poses.empty() ? std::vector<double>{} : values(poses);
        for (double& log : out) log = mixed(log, nullptr);
        return out;
    }

  private:
    double step(int k) const { return k < 3 ? shift : turn; }

    Pose stepped(const Pose& pose, const Vec3& centre, int a, double by_a, int b = -1, double by_b = 0) const {
        double xi[6] = {};
        xi[a] += by_a * step(a);
        if (b >= 0) xi[b] += by_b * step(b);
        return moved(pose, load(xi), load(xi + 3), centre);
    }

    // Log density with outliers, and the probability that the measurement is no outlier.
    double mixed(double log, double* inlier) const {
        if (!(outlier_rate > 0)) {
            if (inlier) *inlier = 1;
            return std::max(log, -1e300);
        }
        const double on = std::log1p(-outlier_rate) + log, off = std::log(outlier_rate), top = std::max(on, off);
        const double sum = top + std::log(std::exp(on - top) + std::exp(off - top));
        if (inlier) *inlier = std::exp(on - sum);
        return sum;
    }

    std::vector<double> values(const std::vector<Pose>& poses) const {
        const Doubles found = called(*log_density, poses, "log_density");
        if (found.ndim() != 1 || found.shape(0) != poses.size())
            refuse(name.c_str(), "expected log_density to return one number for each of " +
                                     std::to_string(poses.size()) + " poses");
        std::vector<double> out(found.data(), found.data() + poses.size());
        for (const double value : out)
            if (std::isnan(value) || value == INFINITY)
                refuse(name.c_str(), "expected log_density to return finite numbers or -inf, got nan or inf");
        return out;
    }

    Doubles called(const nb::callable& f, const std::vector<Pose>& poses, const char* what) const {
        nb::object result = f(poses_out(poses));
        nb::module_ numpy = nb::module_::import_("numpy");
        result = numpy.attr("ascontiguousarray")(result, "dtype"_a = "float64");
        Doubles out;
        if (!nb::try_cast(result, out)) refuse(name.c_str(), std::string("expected ") + what + " to return an array");
        return out;
    }

    double from_values(const Pose& pose, const Vec3& centre, double* g, double* H) const {
        std::vector<Pose> all{pose};
        for (int a = 0; a < 6; ++a)
            for (const double s : {1.0, -1.0}) all.push_back(stepped(pose, centre, a, s));
        for (int a = 0; a < 6; ++a)
            for (int b = 0; b < a; ++b)
                for (const double s : {1.0, -1.0}) all.push_back(stepped(pose, centre, a, s, b, s));
        std::vector<double> l = values(all);
        for (double& value : l) value = std::max(value, -1e12);
        size_t k = 13;
        for (int a = 0; a < 6; ++a) {
            const double up = l[1 + 2 * a], down = l[2 + 2 * a], h = step(a);
            g[a] = (up - down) / (2 * h);
            H[7 * a] = (up - 2 * l[0] + down) / (h * h);
            for (int b = 0; b < a; ++b, k += 2) {
                const double cross = l[k] - up - l[1 + 2 * b] + 2 * l[0] - down - l[2 + 2 * b] + l[k + 1];
                H[6 * a + b] = H[6 * b + a] = cross / (2 * h * step(b));
            }
        }
        return l[0];
    }

    // Gradients are by small motions T exp(xi) about the origin of the part: (v, w) there is (v + w x c, w) at its centre.
    double from_gradients(const Pose& pose, const Vec3& centre, double* g, double* H) const {
        std::vector<Pose> all{pose};
        for (int a = 0; a < 6; ++a)
            for (const double s : {1.0, -1.0}) all.push_back(stepped(pose, centre, a, s));
        const Doubles found = called(*gradient, all, "gradient");
        if (found.ndim() != 2 || found.shape(0) != all.size() || found.shape(1) != 6)
            refuse(name.c_str(), "expected gradient to return six numbers for each pose");
        const auto at_centre = [&](size_t row, double* out) {
            const Vec3 v = load(found.data() + 6 * row), w = load(found.data() + 6 * row + 3);
            store(v, out);
            store(w - cross(centre, v), out + 3);
        };
        at_centre(0, g);
        for (int a = 0; a < 6; ++a) {
            double up[6], down[6];
            at_centre(1 + 2 * a, up);
            at_centre(2 + 2 * a, down);
            for (int b = 0; b < 6; ++b) H[6 * a + b] = (up[b] - down[b]) / (2 * step(a));
        }
        for (int a = 0; a < 6; ++a) {
            for (int b = 0; b < a; ++b) H[6 * a + b] = H[6 * b + a] = 0.5 * (H[6 * a + b] + H[6 * b + a]);
            if (!std::isfinite(g[a])) refuse(name.c_str(), "expected gradient to return finite numbers");
        }
        return values({pose})[0];
    }

    // Minus a matrix of second derivatives, without its negative eigenvalues in units of the steps.
    std::vector<double> not_negative_part(const double* H) const {
        std::vector<double> A(36), out(36, 0.0);
        for (int a = 0; a < 6; ++a)
            for (int b = 0; b < 6; ++b) {
                const double value = -H[6 * a + b] * step(a) * step(b);
                A[6 * a + b] = std::isfinite(value) ? value : 0.0;
            }
        const Eigen found = eigen(A, 6);
        for (int k = 0; k < 6; ++k)
            for (int a = 0; a < 6; ++a)
                for (int b = 0; b < 6; ++b)
                    out[6 * a + b] += std::max(found.values[k], 0.0) * found.vectors[6 * a + k] *
                                      found.vectors[6 * b + k] / (step(a) * step(b));
        return out;
    }

    std::string name;
    mutable std::optional<nb::callable> log_density, gradient;
    double shift, turn, outlier_rate;
};

std::shared_ptr<PoseTerm> python_term(std::string name, nb::callable log_density, std::optional<nb::callable> gradient,
                                      double shift, double turn, double outlier_rate) {
    return std::make_shared<PythonTerm>(std::move(name), std::move(log_density), std::move(gradient),
                                        expect(shift, "shift", 1e-12, 1), expect(turn, "turn", 1e-12, 1),
                                        expect(outlier_rate, "outlier_rate", 0, 1));
}

}  // namespace

void offer_python_terms(nb::module_& m) {
    m.def("python_term", &python_term, "name"_a, "log_density"_a, "gradient"_a.none(), "shift"_a, "turn"_a,
          "outlier_rate"_a);
}

}  // namespace tanteo
