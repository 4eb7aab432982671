#include "contacts.hpp"

#include <algorithm>
#include <cmath>

void Contacts::clear() {
    m_points.clear();
    m_rows.clear();
    m_touching.clear();
}

std::size_t Contacts::index_of(std::size_t body) {
    const auto found = std::find(m_touching.begin(), m_touching.end(), body);
    if (found != m_touching.end()) {
        return static_cast<std::size_t>(found - m_touching.begin());
    }
    m_touching.push_back(body);
    return m_touching.size() - 1;
}

void Contacts::add(std::size_t body, btScalar side, btManifoldPoint& point, const Kinematics& kinematics) {
    btPlaneSpace1(point.m_normalWorldOnB, point.m_lateralFrictionDir1, point.m_lateralFrictionDir2);
    point.m_lateralFrictionDir1.normalize();
    point.m_lateralFrictionDir2.normalize();
    const btVector3 arm = (side > 0 ? point.getPositionWorldOnA() : point.getPositionWorldOnB()) - kinematics.joint[body];
    const std::size_t index = index_of(body);
    m_points.push_back(&point);
    for (const btVector3* direction :
         {&point.m_normalWorldOnB, &point.m_lateralFrictionDir1, &point.m_lateralFrictionDir2}) {
        const btVector3 force = *direction * side;
        const btVector3 torque = arm.cross(force);
        m_rows.push_back({index, {torque.x(), torque.y(), torque.z(), force.x(), force.y(), force.z()}, 0, 0, 0});
    }
}

// The motions of all touching bodies due to six unit wrenches on one of them.
void Contacts::respond(std::size_t touching) {
    const auto& tree = m_articulation.bodies();
    for (std::size_t i = 0; i < tree.size(); ++i) {
        if (m_needed[i]) {
            m_torques[i] = Columns{};
        }
    }
    // Inwards, from the body to the root: torques about its joint, and the forces that are left at it.
    Columns torque{}, force{};
    for (int k = 0; k < 3; ++k) {
        torque.v[k][k] = 1;
        force.v[k][3 + k] = 1;
    }
    std::size_t i = m_touching[touching];
    while (i > 0) {
        const Articulation::Body& body = tree[i];
        m_torques[i] = torque;
        force = force - product(body.coupling, torque);
        torque = cross(body.arm, force);
        i = static_cast<std::size_t>(body.parent);
    }
    Response& root = m_columns[0];
    root = Response{};
    for (int k = 0; k < 6; ++k) {
        const Motion motion = m_articulation.root({btVector3(torque.v[0][k], torque.v[1][k], torque.v[2][k]),
                                                   btVector3(force.v[0][k], force.v[1][k], force.v[2][k])});
        for (int axis = 0; axis < 3; ++axis) {
            root.angular.v[axis][k] = motion.angular[axis];
            root.linear.v[axis][k] = motion.linear[axis];
        }
    }
    // Outwards, to all bodies with contacts.
    for (std::size_t b = 1; b < tree.size(); ++b) {
        if (!m_needed[b]) {
            continue;
        }
        const Articulation::Body& body = tree[b];
        const Response& parent = m_columns[static_cast<std::size_t>(body.parent)];
        Response& own = m_columns[b];
        own.linear = parent.linear - cross(body.arm, parent.angular);
        own.angular = product(body.inverse, m_torques[b] - product(body.H, own.linear));
    }
    btScalar* out = &m_unit[6 * touching * stride()];
    for (std::size_t t = 0; t < m_touching.size(); ++t) {
        const Response& response = m_columns[m_touching[t]];
        for (std::size_t k = 0; k < 6; ++k) {
            for (std::size_t axis = 0; axis < 3; ++axis) {
                out[k * stride() + 6 * t + axis] = response.angular.v[axis][k];
                out[k * stride() + 6 * t + 3 + axis] = response.linear.v[axis][k];
            }
        }
    }
}

void Contacts::prepare(const std::vector<Motion>& velocities, const btContactSolverInfo& info) {
    const auto& tree = m_articulation.bodies();
    m_needed.assign(tree.size(), 0);
    m_columns.resize(tree.size());
    m_torques.resize(tree.size());
    for (std::size_t body : m_touching) {
        for (std::size_t i = body; i > 0 && !m_needed[i]; i = static_cast<std::size_t>(tree[i].parent)) {
            m_needed[i] = 1;
        }
    }
    const std::size_t count = stride();
    m_unit.resize(6 * m_touching.size() * count);
    for (std::size_t t = 0; t < m_touching.size(); ++t) {
        respond(t);
    }
    m_responses.assign(m_rows.size() * count, 0);
    for (std::size_t r = 0; r < m_rows.size(); ++r) {
        Row& row = m_rows[r];
        btScalar* response = &m_responses[r * count];
        for (std::size_t k = 0; k < 6; ++k) {
            const btScalar* unit = &m_unit[(6 * row.body + k) * count];
            for (std::size_t j = 0; j < count; ++j) {
                response[j] += row.wrench[k] * unit[j];
            }
        }
        const Motion& velocity = velocities[m_touching[row.body]];
        btScalar own = 0, speed = 0;
        for (std::size_t k = 0; k < 6; ++k) {
            own += row.wrench[k] * response[6 * row.body + k];
            speed += row.wrench[k] * (k < 3 ? velocity.angular[static_cast<int>(k)] : velocity.linear[static_cast<int>(k) - 3]);
        }
        row.inverse = own > SIMD_EPSILON ? 1 / own : 0;
        btScalar wanted = -speed;
        if (r % 3 == 0) {
            const btScalar distance = m_points[r / 3]->getDistance() + info.m_linearSlop;
            // A gap may be closed in this step, a penetration is corrected in part.
            wanted -= distance * (distance > 0 ? 1 : info.m_erp2) / info.m_timeStep;
        }
        row.target = wanted * row.inverse;
        row.impulse = 0;
    }
    m_motion.assign(count, 0);
}

// The change of a row's impulse that would bring its velocity to the target.
btScalar Contacts::correction(const Row& row) const {
    const btScalar* w = row.wrench;
    const btScalar* v = &m_motion[6 * row.body];
    const btScalar speed = (w[0] * v[0] + w[1] * v[1] + w[2] * v[2]) + (w[3] * v[3] + w[4] * v[4] + w[5] * v[5]);
    return row.target - speed * row.inverse;
}

void Contacts::apply(std::size_t r, btScalar change) {
    const btScalar* response = &m_responses[r * m_motion.size()];
    for (std::size_t j = 0; j < m_motion.size(); ++j) {
        m_motion[j] += response[j] * change;
    }
}

// Changes all impulses once; returns the square of the largest change of velocity.
btScalar Contacts::iterate() {
    btScalar largest = 0;
    for (std::size_t p = 0; p < m_points.size(); ++p) {
        Row& row = m_rows[3 * p];
        const btScalar impulse = std::max(row.impulse + correction(row), btScalar(0));
        const btScalar change = impulse - row.impulse;
        row.impulse = impulse;
        apply(3 * p, change);
        const btScalar residual = row.inverse > 0 ? change / row.inverse : 0;
        largest = std::max(largest, residual * residual);
    }
    for (std::size_t p = 0; p < m_points.size(); ++p) {
        Row& a = m_rows[3 * p + 1];
        Row& b = m_rows[3 * p + 2];
        const btScalar limit = m_points[p]->m_combinedFriction * m_rows[3 * p].impulse;
        btScalar sum_a = a.impulse + correction(a), sum_b = b.impulse + correction(b);
        const btScalar length = std::sqrt(sum_a * sum_a + sum_b * sum_b);
        if (length > limit) {
            sum_a *= limit / length;
            sum_b *= limit / length;
        }
        const btScalar change_a = sum_a - a.impulse, change_b = sum_b - b.impulse;
        a.impulse = sum_a;
        b.impulse = sum_b;
        apply(3 * p + 1, change_a);
        apply(3 * p + 2, change_b);
        const btScalar residual =
            (a.inverse > 0 ? change_a / a.inverse : 0) + (b.inverse > 0 ? change_b / b.inverse : 0);
        largest = std::max(largest, residual * residual);
    }
    return largest;
}

void Contacts::solve(const std::vector<Motion>& velocities, const btContactSolverInfo& info, std::vector<Motion>& out) {
    prepare(velocities, info);
    for (int k = 0; k < info.m_numIterations && iterate() > info.m_leastSquaresResidualThreshold; ++k) {
    }
    m_wrenches.assign(velocities.size(), {btVector3(0, 0, 0), btVector3(0, 0, 0)});
    for (std::size_t p = 0; p < m_points.size(); ++p) {
        Wrench& wrench = m_wrenches[m_touching[m_rows[3 * p].body]];
        for (std::size_t r = 3 * p; r < 3 * p + 3; ++r) {
            const Row& row = m_rows[r];
            wrench.torque += btVector3(row.wrench[0], row.wrench[1], row.wrench[2]) * row.impulse;
            wrench.force += btVector3(row.wrench[3], row.wrench[4], row.wrench[5]) * row.impulse;
        }
        btManifoldPoint& point = *m_points[p];
        point.m_appliedImpulse = m_rows[3 * p].impulse;
        point.m_appliedImpulseLateral1 = m_rows[3 * p + 1].impulse;
        point.m_appliedImpulseLateral2 = m_rows[3 * p + 2].impulse;
    }
    m_articulation.respond(m_wrenches, out);
}
