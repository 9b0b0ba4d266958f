#include "shape/shape.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "normal.hpp"

namespace tanteo {

Profile::At Profile::at(const Vec3& p, bool with_bends) const {
    const Vec3 away = p - point;
    const double height = dot(away, axis);
    const Vec3 across = away - height * axis;
    const double rho = norm(across);
    const Vec3 out = rho > 1e-12 ? (1 / rho) * across : any_across(axis);
    At at;
    double by_out, by_axis, tube = 0;
    if (radius == 0) {
        by_out = slope == 0 ? 1 : std::cos(slope);  // slope 0 is a cylinder: no sine is computed
        by_axis = -(slope == 0 ? 0 : std::sin(slope));
        at.distance = sign * ((rho - offset) * by_out + height * by_axis);
    } else {
        const double beyond = rho - offset;
        tube = std::max(std::hypot(beyond, height), 1e-300);
        by_out = beyond / tube;
        by_axis = height / tube;
        at.distance = sign * (tube - radius);
    }
    at.normal = sign * (by_out * out + by_axis * axis);
    if (with_bends) {
        at.e[0] = cross(axis, out);
        at.e[1] = cross(at.normal, at.e[0]);
        at.bend[0] = rho > 1e-12 ? sign * by_out / rho : 0;
        at.bend[1] = radius > 0 ? sign / tube : 0;
    }
    return at;
}

double point_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c, Vec3& q) {  // Ericson, 5.1.5
    const Vec3 ab = b - a, ac = c - a, ap = p - a;
    const double d1 = dot(ab, ap), d2 = dot(ac, ap);
    double v = 0, w = 0;
    if (d1 <= 0 && d2 <= 0) {
    } else {
        const Vec3 bp = p - b, cp = p - c;
        const double d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp), d6 = dot(ac, cp);
        const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
        if (d3 >= 0 && d4 <= d3) {
            v = 1;
        } else if (vc <= 0 && d1 >= 0 && d3 <= 0) {
            v = d1 > 0 ? d1 / (d1 - d3) : 0;
        } else if (d6 >= 0 && d5 <= d6) {
            w = 1;
        } else if (vb <= 0 && d2 >= 0 && d6 <= 0) {
            w = d2 > 0 ? d2 / (d2 - d6) : 0;
        } else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
            w = d4 > d3 ? (d4 - d3) / ((d4 - d3) + (d5 - d6)) : 0;
            v = 1 - w;
        } else {  // the sum is twice the area, squared
            const double scale = 1 / (va + vb + vc);
            v = vb * scale;
            w = vc * scale;
        }
    }
    q = a + v * ab + w * ac;
    return squared(p - q);
}

Closest Shape::closest(const Vec3& p, int guess) const {
    Closest best = closest_of(p, guess);
    const auto squared_distance = [&](int t, double limit) {
        Vec3 q;
        const double off = dot(normals[t], p - vertices[triangles[3 * t]]);  // no point of a triangle is nearer than its plane
        if (off * off > limit * (1 + 1e-12)) return 1e300;
        const double d2 = point_triangle(p, vertices[triangles[3 * t]], vertices[triangles[3 * t + 1]],
                                         vertices[triangles[3 * t + 2]], q);
        if (d2 < limit) {
            best.squared = d2;
            best.point = q;
            best.triangle = t;
        }
        return d2;
    };
    triangle_tree.closest(p, best.squared, squared_distance);
    return best;
}

Closest Shape::closest(const Vec3& p) const { return closest(p, near_triangle(p)); }

Closest Shape::closest_about(const Vec3& p) const { return closest_of(p, near_triangle(p)); }

Closest Shape::closest_of(const Vec3& p, int triangle) const {
    Closest at;
    at.triangle = triangle;
    const int* corner = &triangles[3 * triangle];
    at.squared = point_triangle(p, vertices[corner[0]], vertices[corner[1]], vertices[corner[2]], at.point);
    return at;
}

int Shape::near_triangle(const Vec3& p) const {
    const Cell cell = cell_of(p);
    const size_t row = grid_shape[2], plane = row * grid_shape[1];
    return grid_triangle[cell.node + (cell.f[0] > 0.5) * plane + (cell.f[1] > 0.5) * row + (cell.f[2] > 0.5)];
}

const std::vector<int>& Shape::neighbours() const {
    std::call_once(beyond->once, [&] {
        std::vector<std::array<int, 3>> sides;  // the ends of each side, the lower one first, and its number
        for (size_t k = 0; k < triangles.size(); ++k) {
            const int a = triangles[k], b = triangles[k % 3 == 2 ? k - 2 : k + 1];
            sides.push_back({std::min(a, b), std::max(a, b), static_cast<int>(k)});
        }
        std::sort(sides.begin(), sides.end());
        beyond->rows.assign(sides.size(), -1);
        for (size_t k = 0; k + 1 < sides.size(); ++k)
            if (sides[k][0] == sides[k + 1][0] && sides[k][1] == sides[k + 1][1]) {
                beyond->rows[sides[k][2]] = sides[k + 1][2] / 3;
                beyond->rows[sides[k + 1][2]] = sides[k][2] / 3;
            }
    });
    return beyond->rows;
}

double Shape::hit_at(int t, const Vec3& origin, const Vec3& direction) const {
    const Vec3 &a = vertices[triangles[3 * t]], &b = vertices[triangles[3 * t + 1]], &c = vertices[triangles[3 * t + 2]];
    const Vec3 e1 = b - a, e2 = c - a, h = cross(direction, e2);  // Moeller and Trumbore 1997
    const double det = dot(e1, h);
    if (std::fabs(det) < 1e-300) return 1e300;
    const Vec3 s = origin - a;
    const double u = dot(s, h) / det, slack = 1e-9;
    if (u < -slack || u > 1 + slack) return 1e300;
    const Vec3 q = cross(s, e1);
    const double v = dot(direction, q) / det;
    if (v < -slack || u + v > 1 + slack) return 1e300;
    const double along = dot(e2, q) / det;
    return along > 0 ? along : 1e300;
}

double Shape::cast(const Vec3& origin, const Vec3& direction, double reach, int* triangle, int guess) const {
    int which = -1;
    if (guess >= 0) {
        const double there = hit_at(guess, origin, direction);
        if (there < reach) {
            reach = there;
            which = guess;
        }
    }
    const double far = triangle_tree.cast(origin, direction, reach, [&](int t, double nearest) {
        const double along = hit_at(t, origin, direction);
        if (along >= nearest) return 1e300;
        which = t;
        return along;
    });
    if (triangle) *triangle = which;
    return which < 0 ? 1e300 : far;
}

Shape::Cell Shape::cell_of(const Vec3& p) const {
    Cell cell{0, {0, 0, 0}, 0};
    for (int k = 0; k < 3; ++k) {
        const double l = (p[k] - grid_origin[k]) / grid_step;
        const double m = l > 0 ? std::min(l, grid_shape[k] - 1.001) : 0.0;  // 0 also for nan
        const int i = static_cast<int>(m);
        cell.away += (l - m) * (l - m);
        cell.f[k] = m - i;
        cell.node = cell.node * grid_shape[k] + i;
    }
    return cell;
}

double Shape::field(const Vec3& p, int* flat) const {
    const Cell cell = cell_of(p);
    const double* f = cell.f;
    const size_t row = grid_shape[2], plane = row * grid_shape[1];
    const float* g = &grid[cell.node];
    const double x0 = g[0] + (g[1] - g[0]) * f[2], x1 = g[row] + (g[row + 1] - g[row]) * f[2];
    const double x2 = g[plane] + (g[plane + 1] - g[plane]) * f[2];
    const double x3 = g[plane + row] + (g[plane + row + 1] - g[plane + row]) * f[2];
    if (flat)
        *flat = std::max(0, flat_of[grid_triangle[cell.node + (f[0] > 0.5) * plane + (f[1] > 0.5) * row + (f[2] > 0.5)]]);
    const double y0 = x0 + (x1 - x0) * f[1], y1 = x2 + (x3 - x2) * f[1], d = y0 + (y1 - y0) * f[0];
    return cell.away > 0 ? d + grid_step * std::sqrt(cell.away) : d;
}

}  // namespace tanteo
