// Small matrices of fixed size, so that products such as J' W J are written as products. Plain values, row-major.
#pragma once
#include "vec.hpp"

namespace tanteo {

template <int R, int C>
struct Matrix {
    double m[R * C] = {};

    double& operator()(int i, int j) { return m[C * i + j]; }
    double operator()(int i, int j) const { return m[C * i + j]; }
    double& operator[](int i) { return m[i]; }  // of a row or column
    double operator[](int i) const { return m[i]; }
    double* data() { return m; }
    const double* data() const { return m; }
    static constexpr int size() { return R * C; }

    void set(int row, int column, const Mat3& block) {
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) (*this)(row + i, column + j) = block(i, j);
    }
    Matrix& operator+=(const Matrix& other) {
        for (int i = 0; i < R * C; ++i) m[i] += other.m[i];
        return *this;
    }
};

template <int R, int C>
Matrix<R, C> operator*(double s, Matrix<R, C> A) {
    for (double& a : A.m) a *= s;
    return A;
}
template <int R, int K, int C>
Matrix<R, C> operator*(const Matrix<R, K>& A, const Matrix<K, C>& B) {
    Matrix<R, C> out;
    for (int i = 0; i < R; ++i)
        for (int k = 0; k < K; ++k)
            for (int j = 0; j < C; ++j) out(i, j) += A(i, k) * B(k, j);
    return out;
}
template <int R, int C>
Matrix<C, R> transposed(const Matrix<R, C>& A) {
    Matrix<C, R> out;
    for (int i = 0; i < R; ++i)
        for (int j = 0; j < C; ++j) out(j, i) = A(i, j);
    return out;
}
template <int N>
Matrix<N, N> identity_of() {
    Matrix<N, N> out;
    for (int i = 0; i < N; ++i) out(i, i) = 1;
    return out;
}
template <int N>
double squared(const Matrix<N, 1>& a) {
    double sum = 0;
    for (const double x : a.m) sum += x * x;
    return sum;
}

// The matrix of a cross product: hat(a) b = a x b.
inline Mat3 hat(const Vec3& a) { return {{0, -a.z, a.y, a.z, 0, -a.x, -a.y, a.x, 0}}; }

}  // namespace tanteo
