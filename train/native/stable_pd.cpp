#include "stable_pd.hpp"

#include <algorithm>
#include <cmath>

#include "matrices.hpp"

namespace {

// The shorter of the two rotations.
btVector3 rotation_vector(const btQuaternion& q) {
    const btVector3 axis(q.x(), q.y(), q.z());
    const btScalar sine = axis.length();
    if (sine < btScalar(1e-12)) {
        return btVector3(0, 0, 0);
    }
    const btScalar half = q.w() < 0 ? std::atan2(-sine, -q.w()) : std::atan2(sine, q.w());
    return axis * (2 * half / sine);
}

btVector3 clamped(const btVector3& v, btScalar limit) {
    return btVector3(std::clamp(v.x(), -limit, limit), std::clamp(v.y(), -limit, limit),
                     std::clamp(v.z(), -limit, limit));
}

} // namespace

StablePd::StablePd(const Description& bodies, const WorldSettings& settings)
    : m_bodies(bodies),
      m_step(settings.time_step),
      m_gravity(settings.gravity),
      m_fixed(settings.fixed_root),
      m_tree(bodies.size()),
      m_joints(bodies.size()) {}

// Every body on its own, and the PD law of every joint.
void StablePd::collect(const State& state, const Kinematics& k, const btQuaternion* targets,
                       const btVector3* velocities) {
    for (std::size_t i = 0; i < m_bodies.size(); ++i) {
        const Body& body = m_bodies[i];
        const btVector3 arm = k.center[i] - k.joint[i];
        const btVector3& turn = k.angular[i];
        const btMatrix3x3 own = k.rotation[i].scaled(body.control_inertia) * k.rotation[i].transpose();
        const btMatrix3x3 lever = skew(arm);
        Articulated& t = m_tree[i];
        t.M = btMatrix3x3(body.mass, 0, 0, 0, body.mass, 0, 0, 0, body.mass);
        t.H = scaled(lever, body.mass);
        t.J = own - t.H * lever;
        t.force = turn.cross(turn.cross(arm)) * body.mass;
        t.torque = arm.cross(t.force) + turn.cross(own * turn);
        if (i == 0) {
            continue;
        }
        const std::size_t p = static_cast<std::size_t>(body.parent);
        const btQuaternion& q = state.joints[i];
        const btVector3& v = state.velocities[i];
        btQuaternion ahead = q + q * btQuaternion(v.x(), v.y(), v.z(), 0) * (btScalar(0.5) * m_step);
        ahead.normalize();
        const btVector3 error = rotation_vector(ahead.inverse() * targets[i - 1]);
        Joint& j = m_joints[i];
        j.law = k.rotation[i] * (error * body.stiffness + (velocities[i - 1] - v) * body.damping);
        j.arm = k.joint[i] - k.joint[p];
        j.spin = k.angular[p].cross(k.relative[i]);
        j.pull = k.angular[p].cross(k.angular[p].cross(j.arm));
    }
}

// Attach a body, with everything attached to it, to its parent.
void StablePd::reduce(std::size_t i) {
    const Body& body = m_bodies[i];
    const Articulated& t = m_tree[i];
    Joint& j = m_joints[i];
    const btScalar own = body.damping * m_step;
    btMatrix3x3 D = t.J;
    D[0][0] += own;
    D[1][1] += own;
    D[2][2] += own;
    j.inverse = D.inverse();
    const btMatrix3x3 DH = j.inverse * t.H;
    const btVector3 free = j.inverse * (j.law - t.torque);
    // J - J D^-1 J = dt Kd D^-1 J, as D = J + dt Kd.
    const btMatrix3x3 J = scaled(j.inverse * t.J, own);
    const btMatrix3x3 H = scaled(DH, own);
    const btMatrix3x3 M = t.M - t.H.transpose() * DH;
    const btVector3 torque = t.torque + t.J * free + J * j.spin + H * j.pull;
    const btVector3 force = t.force + t.H.transpose() * free + H.transpose() * j.spin + M * j.pull;
    const btMatrix3x3 lever = skew(j.arm);
    const btMatrix3x3 HM = H + lever * M;
    Articulated& parent = m_tree[static_cast<std::size_t>(body.parent)];
    parent.J += J - H * lever + lever * HM.transpose();
    parent.H += HM;
    parent.M += M;
    parent.torque += torque + j.arm.cross(force);
    parent.force += force;
}

void StablePd::root() {
    const Articulated& t = m_tree[0];
    Joint& j = m_joints[0];
    if (m_fixed) {
        // Being held against gravity is equivalent to being accelerated upwards.
        j.angular.setZero();
        j.linear.setValue(0, 0, m_gravity);
        return;
    }
    const btMatrix3x3 HM = t.H * t.M.inverse();
    j.angular = (t.J - HM * t.H.transpose()).inverse() * (HM * t.force - t.torque);
    j.linear = t.M.inverse() * -(t.force + t.H.transpose() * j.angular);
}

void StablePd::torques(const State& state, const Kinematics& k, const btQuaternion* targets,
                       const btVector3* target_velocities, std::vector<btVector3>& out) {
    collect(state, k, targets, target_velocities);
    for (std::size_t i = m_bodies.size() - 1; i > 0; --i) {
        reduce(i);
    }
    root();
    for (std::size_t i = 1; i < m_bodies.size(); ++i) {
        const Body& body = m_bodies[i];
        const Articulated& t = m_tree[i];
        const Joint& parent = m_joints[static_cast<std::size_t>(body.parent)];
        Joint& j = m_joints[i];
        const btVector3 angular = parent.angular + j.spin;
        j.linear = parent.linear + parent.angular.cross(j.arm) + j.pull;
        const btVector3 own = j.inverse * (j.law - t.torque - t.J * angular - t.H * j.linear);
        j.angular = angular + own;
        const btVector3 torque = j.law - own * (body.damping * m_step);
        out[i] = clamped(k.rotation[i].transpose() * torque, body.torque_limit);
    }
}
