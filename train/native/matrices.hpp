// Small matrices that Bullet does not have.
#pragma once

#include "LinearMath/btMatrix3x3.h"

// The matrix of a cross product: skew(a) b = a x b.
inline btMatrix3x3 skew(const btVector3& v) {
    return btMatrix3x3(0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0);
}

inline btMatrix3x3 scaled(const btMatrix3x3& m, btScalar s) {
    return btMatrix3x3(m[0] * s, m[1] * s, m[2] * s);
}
