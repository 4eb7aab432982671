#include "articulation.hpp"

#include "matrices.hpp"

Articulation::Articulation(const Description& bodies, bool fixed_root)
    : m_bodies(bodies),
      m_fixed(fixed_root),
      m_tree(bodies.size()),
      m_wrenches(bodies.size()),
      m_no_bias(bodies.size(), btVector3(0, 0, 0)) {}

void Articulation::update(const Kinematics& k, btScalar factor) {
    for (std::size_t i = 0; i < m_bodies.size(); ++i) {
        const ::Body& body = m_bodies[i];
        const btScalar mass = body.mass * factor;
        const btMatrix3x3 lever = skew(k.center[i] - k.joint[i]);
        Body& t = m_tree[i];
        t.parent = body.parent;
        t.arm = i > 0 ? k.joint[i] - k.joint[static_cast<std::size_t>(body.parent)] : btVector3(0, 0, 0);
        t.M = btMatrix3x3(mass, 0, 0, 0, mass, 0, 0, 0, mass);
        t.H = scaled(lever, mass);
        t.J = k.rotation[i].scaled(body.inertia * factor) * k.rotation[i].transpose() - t.H * lever;
    }
    for (std::size_t i = m_bodies.size() - 1; i > 0; --i) {
        Body& t = m_tree[i];
        t.inverse = t.J.inverse();
        t.coupling = t.H.transpose() * t.inverse;
        t.apparent = t.M - t.coupling * t.H;
        const btMatrix3x3 lever = skew(t.arm);
        const btMatrix3x3 H = lever * t.apparent;
        Body& parent = m_tree[static_cast<std::size_t>(t.parent)];
        parent.J += lever * H.transpose();
        parent.H += H;
        parent.M += t.apparent;
    }
    const Body& t = m_tree[0];
    m_mass = t.M.inverse();
    m_lever = t.H * m_mass;
    m_turning = (t.J - m_lever * t.H.transpose()).inverse();
}

Motion Articulation::root(const Wrench& wrench) const {
    if (m_fixed) {
        return {btVector3(0, 0, 0), btVector3(0, 0, 0)};
    }
    const btVector3 angular = m_turning * (wrench.torque - m_lever * wrench.force);
    return {angular, m_mass * (wrench.force - m_tree[0].H.transpose() * angular)};
}

void Articulation::respond(const std::vector<Wrench>& wrenches, std::vector<Motion>& out) {
    respond(wrenches, m_no_bias, out);
}

void Articulation::respond(const std::vector<Wrench>& wrenches, const std::vector<btVector3>& bias,
                           std::vector<Motion>& out) {
    m_wrenches = wrenches;
    for (std::size_t i = m_tree.size() - 1; i > 0; --i) {
        const Body& t = m_tree[i];
        const Wrench& own = m_wrenches[i];
        const btVector3 force = own.force - t.coupling * own.torque - t.apparent * bias[i];
        Wrench& parent = m_wrenches[static_cast<std::size_t>(t.parent)];
        parent.force += force;
        parent.torque += t.arm.cross(force);
    }
    out.resize(m_tree.size());
    out[0] = root(m_wrenches[0]);
    for (std::size_t i = 1; i < m_tree.size(); ++i) {
        const Body& t = m_tree[i];
        const Motion& parent = out[static_cast<std::size_t>(t.parent)];
        out[i].linear = parent.linear + parent.angular.cross(t.arm) + bias[i];
        out[i].angular = t.inverse * (m_wrenches[i].torque - t.H * out[i].linear);
    }
}
