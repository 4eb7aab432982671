#include "dynamics.hpp"

#include "BulletDynamics/Featherstone/btMultiBodyLinkCollider.h"

namespace {

btVector3 vector(const btScalar* v) {
    return btVector3(v[0], v[1], v[2]);
}

void write(btScalar* out, const btVector3& v) {
    for (int axis = 0; axis < 3; ++axis) {
        out[axis] = v[axis];
    }
}

} // namespace

Dynamics::Dynamics(const Description& bodies, const WorldSettings& settings, const Kinematics& kinematics)
    : m_bodies(bodies),
      m_kinematics(kinematics),
      m_articulation(bodies, settings.fixed_root),
      m_contacts(m_articulation),
      m_wrenches(bodies.size()),
      m_bias(bodies.size(), btVector3(0, 0, 0)),
      m_motions(bodies.size()),
      m_answer(bodies.size()),
      m_coordinates(6 + 3 * (bodies.size() - 1)) {}

// All torques and forces on every body, about its joint: external ones, of the joints, and of inertia.
void Dynamics::collect() {
    const Kinematics& k = m_kinematics;
    for (std::size_t i = 0; i < m_bodies.size(); ++i) {
        const int link = static_cast<int>(i) - 1;
        const Body& body = m_bodies[i];
        const btVector3 arm = k.center[i] - k.joint[i];
        const btVector3& turn = k.angular[i];
        const btVector3 spin = k.rotation[i] * (body.inertia * (turn * k.rotation[i]));
        btVector3 force = i > 0 ? m_multi->getLinkForce(link) : m_multi->getBaseForce();
        force -= turn.cross(turn.cross(arm)) * (body.mass * m_mass);
        const btVector3& torque = i > 0 ? m_multi->getLinkTorque(link) : m_multi->getBaseTorque();
        m_wrenches[i] = {torque + arm.cross(force) - turn.cross(spin) * m_mass, force};
        if (i > 0) {
            const std::size_t p = static_cast<std::size_t>(body.parent);
            const btVector3 motor = k.rotation[i] * vector(m_multi->getJointTorqueMultiDof(link));
            m_wrenches[i].torque += motor;
            m_wrenches[p].torque -= motor;
            m_bias[i] = k.angular[p].cross(k.angular[p].cross(k.joint[i] - k.joint[p]));
        }
    }
}

// Motions as changes of Bullet's coordinates: of the root's centre of mass, then of each joint in its child's frame.
void Dynamics::express(const std::vector<Motion>& motions) {
    const Kinematics& k = m_kinematics;
    write(&m_coordinates[0], motions[0].angular);
    write(&m_coordinates[3], motions[0].linear + motions[0].angular.cross(k.center[0] - k.joint[0]));
    for (std::size_t i = 1; i < m_bodies.size(); ++i) {
        const Motion& parent = motions[static_cast<std::size_t>(m_bodies[i].parent)];
        write(&m_coordinates[3 + 3 * i], (motions[i].angular - parent.angular) * k.rotation[i]);
    }
}

void Dynamics::accelerate(btScalar time_step) {
    const Kinematics& k = m_kinematics;
    m_articulation.update(k, m_mass);
    collect();
    m_articulation.respond(m_wrenches, m_bias, m_answer);
    // Accelerations of coordinates: without what velocities alone do.
    m_answer[0].linear += k.angular[0].cross(k.angular[0].cross(k.center[0] - k.joint[0]));
    express(m_answer);
    for (std::size_t i = 1; i < m_bodies.size(); ++i) {
        const btVector3& turn = k.angular[static_cast<std::size_t>(m_bodies[i].parent)];
        const btVector3 spin = turn.cross(k.relative[i]) * k.rotation[i];
        for (int axis = 0; axis < 3; ++axis) {
            m_coordinates[3 + 3 * i + static_cast<std::size_t>(axis)] -= spin[axis];
        }
    }
    m_multi->applyDeltaVeeMultiDof(m_coordinates.data(), time_step);
}

void Dynamics::add_points(btPersistentManifold& manifold) {
    const auto* first = btMultiBodyLinkCollider::upcast(manifold.getBody0());
    const auto* second = btMultiBodyLinkCollider::upcast(manifold.getBody1());
    const auto* own = first != nullptr ? first : second;
    btAssert(own != nullptr);
    for (int p = 0; p < manifold.getNumContacts(); ++p) {
        m_contacts.add(static_cast<std::size_t>(own->m_link + 1), own == first ? 1 : -1, manifold.getContactPoint(p),
                       m_kinematics);
    }
}

void Dynamics::resolve(btPersistentManifold** manifolds, int count, const btContactSolverInfo& info) {
    m_contacts.clear();
    for (int m = 0; m < count; ++m) {
        add_points(*manifolds[m]);
    }
    if (m_contacts.empty()) {
        return;
    }
    const Kinematics& k = m_kinematics;
    const btScalar* velocity = m_multi->getVelocityVector();
    m_motions[0].angular = vector(velocity);
    m_motions[0].linear = vector(velocity + 3) - m_motions[0].angular.cross(k.center[0] - k.joint[0]);
    for (std::size_t i = 1; i < m_bodies.size(); ++i) {
        const std::size_t p = static_cast<std::size_t>(m_bodies[i].parent);
        m_motions[i].angular = m_motions[p].angular + k.rotation[i] * vector(velocity + 3 + 3 * i);
        m_motions[i].linear = m_motions[p].linear + m_motions[p].angular.cross(k.joint[i] - k.joint[p]);
    }
    m_contacts.solve(m_motions, info, m_answer);
    express(m_answer);
    m_multi->applyDeltaVeeMultiDof2(m_coordinates.data(), 1);
}
