// Vectors, matrices and rigid motions of fixed size. Plain values; nothing allocates.
#pragma once
#include <algorithm>
#include <cmath>

namespace tanteo {

struct Vec3 {
    double x = 0, y = 0, z = 0;
    double& operator[](int i) { return (&x)[i]; }
    double operator[](int i) const { return (&x)[i]; }
};

inline Vec3 operator+(const Vec3& a, const Vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator-(const Vec3& a) { return {-a.x, -a.y, -a.z}; }
inline Vec3 operator*(double s, const Vec3& a) { return {s * a.x, s * a.y, s * a.z}; }
inline Vec3& operator+=(Vec3& a, const Vec3& b) { return a = a + b; }
inline double dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(const Vec3& a, const Vec3& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double squared(const Vec3& a) { return dot(a, a); }
inline double norm(const Vec3& a) { return std::sqrt(dot(a, a)); }
inline Vec3 unit(const Vec3& a) {
    const double l = norm(a);
    return l > 0 ? (1 / l) * a : Vec3{1, 0, 0};
}
inline Vec3 load(const double* p) { return {p[0], p[1], p[2]}; }
inline void store(const Vec3& a, double* p) { p[0] = a.x; p[1] = a.y; p[2] = a.z; }

// A unit vector perpendicular to a, deterministic.
inline Vec3 any_across(const Vec3& a) {
    const double x = std::fabs(a.x), y = std::fabs(a.y), z = std::fabs(a.z);
    const Vec3 least = x <= y && x <= z ? Vec3{1, 0, 0} : (y <= z ? Vec3{0, 1, 0} : Vec3{0, 0, 1});
    return unit(cross(a, least));
}

struct Mat3 {  // row-major
    double m[9] = {0, 0, 0, 0, 0, 0, 0, 0, 0};
    double& operator()(int i, int j) { return m[3 * i + j]; }
    double operator()(int i, int j) const { return m[3 * i + j]; }
};

inline Mat3 identity() { return {{1, 0, 0, 0, 1, 0, 0, 0, 1}}; }
inline Mat3 diagonal(double d) { return {{d, 0, 0, 0, d, 0, 0, 0, d}}; }
inline Vec3 operator*(const Mat3& A, const Vec3& v) {
    return {A.m[0] * v.x + A.m[1] * v.y + A.m[2] * v.z, A.m[3] * v.x + A.m[4] * v.y + A.m[5] * v.z,
            A.m[6] * v.x + A.m[7] * v.y + A.m[8] * v.z};
}
inline Vec3 transposed_times(const Mat3& A, const Vec3& v) {
    return {A.m[0] * v.x + A.m[3] * v.y + A.m[6] * v.z, A.m[1] * v.x + A.m[4] * v.y + A.m[7] * v.z,
            A.m[2] * v.x + A.m[5] * v.y + A.m[8] * v.z};
}
inline Mat3 operator*(const Mat3& A, const Mat3& B) {
    Mat3 C;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            C(i, j) = A(i, 0) * B(0, j) + A(i, 1) * B(1, j) + A(i, 2) * B(2, j);
    return C;
}
inline Mat3 transposed(const Mat3& A) {
    return {{A.m[0], A.m[3], A.m[6], A.m[1], A.m[4], A.m[7], A.m[2], A.m[5], A.m[8]}};
}
// R' C R
inline Mat3 turned_into(const Mat3& R, const Mat3& C) { return transposed(R) * (C * R); }
inline void add_outer(Mat3& A, double s, const Vec3& a, const Vec3& b) {
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) A(i, j) += s * a[i] * b[j];
}

// Rotation by a rotation vector, and the inverse; for a half turn one of two vectors is returned.
inline Mat3 rotation(const Vec3& w) {
    const double t2 = squared(w), t = std::sqrt(t2);
    const double a = t < 1e-4 ? 1 - t2 / 6 : std::sin(t) / t;
    const double b = t < 1e-4 ? 0.5 - t2 / 24 : (1 - std::cos(t)) / t2;
    Mat3 R = identity();
    const Mat3 W{{0, -w.z, w.y, w.z, 0, -w.x, -w.y, w.x, 0}}, W2 = W * W;
    for (int i = 0; i < 9; ++i) R.m[i] += a * W.m[i] + b * W2.m[i];
    return R;
}
inline Vec3 rotation_vector(const Mat3& R) {
    const Vec3 v{R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1)};
    const double c = 0.5 * (R(0, 0) + R(1, 1) + R(2, 2) - 1), s = 0.5 * norm(v);
    const double t = std::atan2(s, c);
    if (t < 1e-6) return 0.5 * v;
    if (c > 0 || s > 1e-4) return (0.5 * t / s) * v;
    // near a half turn: the axis from the symmetric part
    int k = 0;
    for (int i = 1; i < 3; ++i)
        if (R(i, i) > R(k, k)) k = i;
    Vec3 axis{R(0, k) + R(k, 0), R(1, k) + R(k, 1), R(2, k) + R(k, 2)};
    axis[k] += 1 - (R(0, 0) + R(1, 1) + R(2, 2));
    axis = unit(axis);
    return (dot(axis, v) < 0 ? -t : t) * axis;
}

// T_world_part maps points of the part to the world. Small motions are about a centre c of the part, which is shifted by v;
// the part is turned about it by w, both in the part frame: c' = c + R v, R' = R exp(w).
struct Pose {
    Mat3 R = identity();
    Vec3 t;
};
inline Pose load_pose(const double* T) {  // 4 x 4, row-major
    return {{{T[0], T[1], T[2], T[4], T[5], T[6], T[8], T[9], T[10]}}, {T[3], T[7], T[11]}};
}
inline void store_pose(const Pose& P, double* T) {
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) T[4 * i + j] = P.R(i, j);
        T[4 * i + 3] = P.t[i];
        T[12 + i] = 0;
    }
    T[15] = 1;
}
inline Vec3 into_part(const Pose& P, const Vec3& x) { return transposed_times(P.R, x - P.t); }
inline Pose moved(const Pose& P, const Vec3& v, const Vec3& w, const Vec3& c) {
    const Vec3 there = P.R * (c + v) + P.t;
    const Mat3 R = P.R * rotation(w);
    return {R, there - R * c};
}
inline void difference(const Pose& from, const Pose& to, const Vec3& c, Vec3& v, Vec3& w) {
    v = transposed_times(from.R, (to.R * c + to.t) - (from.R * c + from.t));
    w = rotation_vector(transposed(from.R) * to.R);
}

// A symmetric matrix without its negative eigenvalues, by Jacobi rotations; most matrices have none.
inline Mat3 not_negative(Mat3 A) {
    const double a = A(1, 1) * A(2, 2) - A(1, 2) * A(1, 2), b = A(0, 0) * A(2, 2) - A(0, 2) * A(0, 2),
                 c = A(0, 0) * A(1, 1) - A(0, 1) * A(0, 1);
    const double det = A(0, 0) * a - A(0, 1) * (A(0, 1) * A(2, 2) - A(0, 2) * A(1, 2)) +
                       A(0, 2) * (A(0, 1) * A(1, 2) - A(0, 2) * A(1, 1));
    const double size = A(0, 0) + A(1, 1) + A(2, 2), small = 1e-12 * size * size;
    if (std::min({A(0, 0), A(1, 1), A(2, 2)}) >= 0 && std::min({a, b, c}) >= -small && det >= -small * size) return A;
    Mat3 V = identity();
    for (int sweep = 0; sweep < 8; ++sweep) {
        double off = 0, on = 0;
        for (int i = 0; i < 3; ++i) {
            on += A(i, i) * A(i, i);
            for (int j = i + 1; j < 3; ++j) off += A(i, j) * A(i, j);
        }
        if (!(off > 1e-26 * on)) break;
        for (int i = 0; i < 3; ++i)
            for (int j = i + 1; j < 3; ++j) {
                if (A(i, j) == 0) continue;
                const double angle = 0.5 * std::atan2(2 * A(i, j), A(i, i) - A(j, j));
                const double c = std::cos(angle), s = std::sin(angle);
                Mat3 G = identity();
                G(i, i) = G(j, j) = c;
                G(j, i) = s;
                G(i, j) = -s;
                A = turned_into(G, A);
                V = V * G;
            }
    }
    Mat3 out;
    for (int k = 0; k < 3; ++k)
        if (A(k, k) > 0) add_outer(out, A(k, k), {V(0, k), V(1, k), V(2, k)}, {V(0, k), V(1, k), V(2, k)});
    return out;
}

// Cholesky factor in place of a symmetric positive definite A (row-major n x n, lower triangle); false if it is not. Then
// solve_cholesky replaces b by the solution of A x = b.
inline bool cholesky(double* A, int n) {
    for (int i = 0; i < n; ++i) {
        int first = 0;  // entries before the first one of a row stay zero
        while (first < i && A[i * n + first] == 0) ++first;
        for (int j = first; j <= i; ++j) {
            double s = A[i * n + j];
            for (int k = first; k < j; ++k) s -= A[i * n + k] * A[j * n + k];
            if (i == j) {
                if (!(s > 0)) return false;
                A[i * n + i] = std::sqrt(s);
            } else {
                A[i * n + j] = s / A[j * n + j];
            }
        }
    }
    return true;
}
inline void solve_cholesky(const double* L, int n, double* b) {
    for (int i = 0; i < n; ++i) {
        for (int k = 0; k < i; ++k) b[i] -= L[i * n + k] * b[k];
        b[i] /= L[i * n + i];
    }
    for (int i = n - 1; i >= 0; --i) {
        for (int k = i + 1; k < n; ++k) b[i] -= L[k * n + i] * b[k];
        b[i] /= L[i * n + i];
    }
}

}  // namespace tanteo
