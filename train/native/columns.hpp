// Columns of three components, side by side in the lanes of the processor's vectors.
#pragma once

#include <cstddef>

#include "LinearMath/btMatrix3x3.h"

// Six columns, one for each unit wrench, and two that stay 0.
struct Columns {
    static constexpr std::size_t width = 8;
    btScalar v[3][width];
};

inline Columns product(const btMatrix3x3& m, const Columns& c) {
    Columns out;
    for (int i = 0; i < 3; ++i) {
        const btScalar x = m[i].x(), y = m[i].y(), z = m[i].z();
        for (std::size_t k = 0; k < Columns::width; ++k) {
            out.v[i][k] = x * c.v[0][k] + y * c.v[1][k] + z * c.v[2][k];
        }
    }
    return out;
}

inline Columns cross(const btVector3& a, const Columns& c) {
    Columns out;
    for (std::size_t k = 0; k < Columns::width; ++k) {
        out.v[0][k] = a.y() * c.v[2][k] - a.z() * c.v[1][k];
        out.v[1][k] = a.z() * c.v[0][k] - a.x() * c.v[2][k];
        out.v[2][k] = a.x() * c.v[1][k] - a.y() * c.v[0][k];
    }
    return out;
}

inline Columns operator-(const Columns& a, const Columns& b) {
    Columns out;
    for (int i = 0; i < 3; ++i) {
        for (std::size_t k = 0; k < Columns::width; ++k) {
            out.v[i][k] = a.v[i][k] - b.v[i][k];
        }
    }
    return out;
}
