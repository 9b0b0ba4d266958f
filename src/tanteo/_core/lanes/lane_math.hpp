// The normal distribution in one and two dimensions on lanes: several numbers in one variable of a type V, double itself for
// one. Only operations that IEEE 754 rounds in one way are used, so that the bits of a result do not depend on the width.
//
// Linkage is internal on purpose: a width is compiled for instructions of its own, and the linker must not exchange its
// functions for those of another one.
#pragma once
#include <cstdint>
#include <cstring>

namespace tanteo {
namespace {

template <class V>
struct LaneBits;  // unsigned integers of the same size
template <>
struct LaneBits<double> {
    using type = uint64_t;
};

template <class To, class From>
inline To same_bits(const From& from) {
    static_assert(sizeof(To) == sizeof(From), "a cast of bits keeps the size");
    To to;
    std::memcpy(&to, &from, sizeof to);
    return to;
}

inline double select(bool chosen, double a, double b) { return chosen ? a : b; }
template <class Mask, class V>
inline V select(const Mask& chosen, const V& a, const V& b) {
    return same_bits<V>((chosen & same_bits<Mask>(a)) | (~chosen & same_bits<Mask>(b)));
}

template <class V>
inline V absolute(const V& x) {
    using Bits = typename LaneBits<V>::type;
    return same_bits<V>(same_bits<Bits>(x) & (~uint64_t{0} >> 1));
}

// exp with a relative error below 1e-15; arguments below -708 give less than 1e-307.
template <class V>
inline V fast_exp(V x) {
    using Bits = typename LaneBits<V>::type;
    x = select(x < -708.0, V{} - 708.0, x);
    x = select(x > 708.0, V{} + 708.0, x);
    const double magic = 6755399441055744.0;  // 1.5 * 2^52: the sum's last bits are the rounded number
    const V shifted = x * 1.4426950408889634074 + magic, k = shifted - magic;
    const V r = (x - k * 6.93145751953125e-1) - k * 1.42860682030941723212e-6;
    V p = V{} + 1.0 / 479001600;
    p = p * r + 1.0 / 39916800;
    p = p * r + 1.0 / 3628800;
    p = p * r + 1.0 / 362880;
    p = p * r + 1.0 / 40320;
    p = p * r + 1.0 / 5040;
    p = p * r + 1.0 / 720;
    p = p * r + 1.0 / 120;
    p = p * r + 1.0 / 24;
    p = p * r + 1.0 / 6;
    p = p * r + 0.5;
    p = p * r + 1.0;
    p = p * r + 1.0;
    const Bits scale = (same_bits<Bits>(shifted) + uint64_t{1023}) << 52;
    return p * same_bits<V>(scale);
}

template <class V>
inline V normal_density(V x) {
    return 0.39894228040143267794 * fast_exp<V>(-0.5 * x * x);
}

// The normal distribution function: with z = |x| and t = (z - 5) / (z + 5), (1 + z) Phi(-z) exp(z^2 / 2) is a polynomial in t
// (Shepherd and Laframboise 1981). The error is below 3e-16, and below 2e-14 of the result for x > -8.
template <class V>
inline V normal_below(V x) {
    constexpr double c[22] = {
        0.46151582985003764,     -0.09155228183401112,    0.031030368425996276,    0.010002352385413518,
        -0.026401042967610918,   0.024536963238891124,    -0.015170415382194151,   0.0065220007252342425,
        -0.0016760725071201736,  7.791214407029197e-06,   0.00018233490375638885,  -5.360602125091955e-05,
        -9.898304711862771e-06,  9.055745037072787e-06,   -6.622356838361439e-08,  -1.3004549261800007e-06,
        1.2293076767880673e-07,  1.884616380755136e-07,   -2.25998667094706e-08,   -2.546678168055119e-08,
        2.075230687424008e-09,   2.2070652717551666e-09};
    V z = absolute(x);
    z = select(z > 40.0, V{} + 40.0, z);
    const V t = (z - 5.0) / (z + 5.0), s = t * t, q = s * s;
    V c0 = V{} + c[20], c1 = V{} + c[21], c2 = V{} + c[18], c3 = V{} + c[19];  // short chains of powers of t^4
    for (int k = 16; k > 0; k -= 4) {
        c0 = c0 * q + c[k];
        c1 = c1 * q + c[k + 1];
        c2 = c2 * q + c[k - 2];
        c3 = c3 * q + c[k - 1];
    }
    c0 = c0 * q + c[0];
    c1 = c1 * q + c[1];
    const V tail = fast_exp<V>(-0.5 * z * z) * ((c0 + s * c2) + t * (c1 + s * c3)) / (1.0 + z);
    return select(x < 0.0, tail, 1.0 - tail);
}

}  // namespace
}  // namespace tanteo
