// The normal distribution for single numbers.
#pragma once
#include "lanes/lane_math.hpp"

namespace tanteo {

constexpr double PI = 3.14159265358979323846;
constexpr double HALF_LOG_TWO_PI = 0.91893853320467274178;

}  // namespace tanteo
