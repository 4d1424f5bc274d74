// Vectors of three. Private to the library.
#pragma once

#include <cmath>

#include "clratio/medium.hpp"

namespace clratio {

inline double dot(const Vector3& a, const Vector3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

inline Vector3 cross(const Vector3& a, const Vector3& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

inline Vector3 difference(const Vector3& a, const Vector3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline Vector3 times(const Vector3& v, double s) { return {v[0] * s, v[1] * s, v[2] * s}; }
inline Vector3 unit(const Vector3& v) { return times(v, 1 / std::hypot(v[0], v[1], v[2])); }

}  // namespace clratio
