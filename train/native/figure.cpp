#include "figure.hpp"

#include <algorithm>
#include <cmath>

namespace {

// The same values as in the pybullet wheel, so that the two engines agree.
const btScalar friction_erp = btScalar(0.2);
const btScalar slop = btScalar(1e-5);
const btScalar warm_starting = btScalar(0.1);
const btScalar residual = btScalar(1e-7);

std::unique_ptr<btCollisionShape> shape_of(const Body& body) {
    const btVector3& s = body.size;
    if (body.shape == Body::Shape::sphere) {
        return std::make_unique<btSphereShape>(s.x() * btScalar(0.5));
    }
    if (body.shape == Body::Shape::capsule) {
        return std::make_unique<btCapsuleShapeZ>(s.x() * btScalar(0.5), s.z() - s.x());
    }
    auto box = std::make_unique<btBoxShape>(s * btScalar(0.5));
    box->setMargin(edge_margin);
    return box;
}

} // namespace

Figure::Figure(const Description& bodies, const WorldSettings& settings)
    : m_bodies(bodies),
      m_settings(settings),
      m_state(bodies.size()),
      m_kinematics(bodies.size()),
      m_dynamics(bodies, settings, m_kinematics),
      m_dispatcher(&m_configuration),
      m_solver(m_dynamics),
      m_world(m_dispatcher, m_broadphase, m_solver, m_configuration, m_dynamics),
      m_obstacles(m_world),
      m_control(bodies, settings),
      m_torques(bodies.size(), btVector3(0, 0, 0)),
      m_peaks(bodies.size(), 0),
      m_last_step(settings.time_step),
      m_friction(settings.friction) {
    build();
    m_state.position.setValue(0, 0, 2);
    reset(State(m_state));
}

Figure::~Figure() {
    for (auto& collider : m_colliders) {
        m_world.removeCollisionObject(collider.get());
    }
    m_world.removeMultiBody(m_multi.get());
    m_world.removeRigidBody(m_ground.get());
}

// Bullet's default sizes are meant for scenes with thousands of objects: 4 MB per figure.
btDefaultCollisionConstructionInfo Figure::small_pools() {
    btDefaultCollisionConstructionInfo info;
    info.m_defaultMaxPersistentManifoldPoolSize = 64;
    info.m_defaultMaxCollisionAlgorithmPoolSize = 64;
    return info;
}

void Figure::build() {
    btContactSolverInfo& info = m_world.getSolverInfo();
    info.m_numIterations = m_settings.iterations;
    info.m_erp2 = m_settings.contact_erp;
    info.m_frictionERP = friction_erp;
    info.m_linearSlop = slop;
    info.m_warmstartingFactor = warm_starting;
    info.m_leastSquaresResidualThreshold = residual;
    info.m_minimumSolverBatchSize = 0;
    m_world.setForceUpdateAllAabbs(false);
    m_world.setGravity(btVector3(0, 0, -m_settings.gravity));

    m_shapes.push_back(std::make_unique<btStaticPlaneShape>(btVector3(0, 0, 1), btScalar(0)));
    m_ground = std::make_unique<btRigidBody>(
        btRigidBody::btRigidBodyConstructionInfo(0, nullptr, m_shapes.back().get()));
    // Bullet multiplies the friction coefficients of two bodies.
    m_ground->setFriction(1);
    m_world.addRigidBody(m_ground.get(), Group::ground, Group::figure | Group::obstacle);

    const Body& root = m_bodies[0];
    const int links = static_cast<int>(m_bodies.size()) - 1;
    m_multi = std::make_unique<btMultiBody>(links, root.mass, root.inertia, m_settings.fixed_root, false);
    for (int link = 0; link < links; ++link) {
        const Body& body = m_bodies[static_cast<std::size_t>(link) + 1];
        const Body& parent = m_bodies[static_cast<std::size_t>(body.parent)];
        m_multi->setupSpherical(link, body.mass, body.inertia, body.parent - 1, btQuaternion::getIdentity(),
                                body.joint - parent.center, body.center, true);
    }
    m_multi->finalizeMultiDof();
    m_dynamics.set_body(*m_multi);
    m_multi->setHasSelfCollision(false);
    m_multi->setUseGyroTerm(true);
    m_multi->setLinearDamping(0);
    m_multi->setAngularDamping(0);
    m_multi->setCanSleep(false);
    m_multi->setMaxCoordinateVelocity(m_settings.free_speed);
    m_world.addMultiBody(m_multi.get());
    for (int link = -1; link < links; ++link) {
        m_shapes.push_back(shape_of(m_bodies[static_cast<std::size_t>(link + 1)]));
        auto collider = std::make_unique<btMultiBodyLinkCollider>(m_multi.get(), link);
        collider->setCollisionShape(m_shapes.back().get());
        collider->setActivationState(DISABLE_DEACTIVATION);
        m_world.addCollisionObject(collider.get(), Group::figure, Group::ground | Group::obstacle);
        if (link < 0) {
            m_multi->setBaseCollider(collider.get());
        } else {
            m_multi->getLink(link).m_collider = collider.get();
        }
        m_colliders.push_back(std::move(collider));
    }
}

// Apply the values of `vary`. A factor of 1 leaves every bit unchanged.
void Figure::embody() {
    m_dynamics.set_mass(m_mass);
    m_multi->setBaseMass(m_bodies[0].mass * m_mass);
    m_multi->setBaseInertia(m_bodies[0].inertia * m_mass);
    for (int link = 0; link < m_multi->getNumLinks(); ++link) {
        const Body& body = m_bodies[static_cast<std::size_t>(link) + 1];
        m_multi->getLink(link).m_mass = body.mass * m_mass;
        m_multi->getLink(link).m_inertiaLocal = body.inertia * m_mass;
    }
    for (auto& collider : m_colliders) {
        collider->setFriction(m_friction);
    }
}

void Figure::write(const State& state) {
    m_state = state;
    if (m_settings.fixed_root) {
        m_state.linear.setZero();
        m_state.angular.setZero();
    }
    m_multi->setBaseWorldTransform(btTransform(m_state.rotation, m_state.position));
    m_multi->setBaseVel(m_state.linear);
    m_multi->setBaseOmega(m_state.angular);
    for (int link = 0; link < m_multi->getNumLinks(); ++link) {
        const std::size_t i = static_cast<std::size_t>(link) + 1;
        btScalar position[4] = {state.joints[i].x(), state.joints[i].y(), state.joints[i].z(), state.joints[i].w()};
        btScalar velocity[3] = {state.velocities[i].x(), state.velocities[i].y(), state.velocities[i].z()};
        m_multi->setJointPosMultiDof(link, position);
        m_multi->setJointVelMultiDof(link, velocity);
    }
    m_multi->clearForcesAndTorques();
    m_multi->clearConstraintForces();
    btAlignedObjectArray<btQuaternion> rotations;
    btAlignedObjectArray<btVector3> origins;
    m_multi->forwardKinematics(rotations, origins);
    m_multi->updateCollisionObjectWorldTransforms(rotations, origins);
    m_kinematics.update(m_bodies, m_state);
}

void Figure::read() {
    m_state.position = m_multi->getBasePos();
    m_state.rotation = m_multi->getWorldToBaseRot().inverse();
    m_state.linear = m_multi->getBaseVel();
    m_state.angular = m_multi->getBaseOmega();
    for (int link = 0; link < m_multi->getNumLinks(); ++link) {
        const std::size_t i = static_cast<std::size_t>(link) + 1;
        const btScalar* position = m_multi->getJointPosMultiDof(link);
        const btScalar* velocity = m_multi->getJointVelMultiDof(link);
        m_state.joints[i].setValue(position[0], position[1], position[2], position[3]);
        m_state.velocities[i].setValue(velocity[0], velocity[1], velocity[2]);
    }
}

void Figure::reset(const State& state) {
    const State before = m_state;
    embody();
    write(state);
    m_frozen = false;
    m_exploded = !sound();
    if (m_exploded) {
        write(before);
    }
    // Obstacles first: objects that are put back into the broad phase are sorted by position.
    m_obstacles.restart();
    forget_contacts();
    std::fill(m_peaks.begin(), m_peaks.end(), btScalar(0));
}

// Contacts are stored in the pairs of the broad phase, whose order depends on the whole history: removing every object
// and adding it again makes a used world equal to a new one.
void Figure::forget_contacts() {
    m_solver.reset();
    m_world.removeRigidBody(m_ground.get());
    for (auto& collider : m_colliders) {
        m_world.removeCollisionObject(collider.get());
    }
    m_obstacles.detach();
    m_broadphase.resetPool(&m_dispatcher);
    m_world.addRigidBody(m_ground.get(), Group::ground, Group::figure | Group::obstacle);
    for (auto& collider : m_colliders) {
        m_world.addCollisionObject(collider.get(), Group::figure, Group::ground | Group::obstacle);
    }
    m_obstacles.attach();
}

bool Figure::sound() const {
    // If a rotation or a joint is not finite, neither is a velocity. Written so that NaN fails.
    const btScalar most = m_settings.fastest * m_settings.fastest;
    return std::isfinite(m_state.position.length2()) &&
           std::all_of(m_kinematics.linear.begin(), m_kinematics.linear.end(),
                       [most](const btVector3& velocity) { return velocity.length2() < most; });
}

// The number of parts into which the next step is divided. Explicit integration of fast joints would add energy.
int Figure::parts() const {
    btScalar fastest = 0;
    for (const btVector3& velocity : m_state.velocities) {
        fastest = std::max(fastest, velocity.length2());
    }
    const btScalar turn = std::sqrt(fastest) * m_settings.time_step / m_settings.largest_turn;
    return turn > 1 ? std::min(static_cast<int>(std::min(std::ceil(turn), btScalar(1e6))), m_settings.most_parts) : 1;
}

void Figure::advance(const btQuaternion* targets, const btVector3* velocities, const btVector3* forces,
                     const btVector3* torques, btScalar time_step) {
    m_control.set_time_step(time_step);
    m_control.torques(m_state, m_kinematics, targets, velocities, m_torques);
    for (std::size_t i = 1; i < m_bodies.size(); ++i) {
        btScalar torque[3] = {m_torques[i].x(), m_torques[i].y(), m_torques[i].z()};
        m_multi->addJointTorqueMultiDof(static_cast<int>(i) - 1, torque);
        m_peaks[i] = std::max({m_peaks[i], std::abs(torque[0]), std::abs(torque[1]), std::abs(torque[2])});
    }
    if (forces != nullptr) {
        m_multi->addBaseForce(forces[0]);
        m_multi->addBaseTorque(torques[0]);
        for (std::size_t i = 1; i < m_bodies.size(); ++i) {
            m_multi->addLinkForce(static_cast<int>(i) - 1, forces[i]);
            m_multi->addLinkTorque(static_cast<int>(i) - 1, torques[i]);
        }
    }
    const State before = m_state;
    m_world.stepSimulation(time_step, 0);
    m_last_step = time_step;
    read();
    m_kinematics.update(m_bodies, m_state);
    if (!sound()) {
        write(before);
        forget_contacts();
        m_exploded = true;
    }
}

void Figure::step(const btQuaternion* targets, const btVector3* velocities, int substeps, const btVector3* forces,
                  const btVector3* torques) {
    if (m_frozen) {
        return;
    }
    std::fill(m_peaks.begin(), m_peaks.end(), btScalar(0));
    const std::size_t joints = m_bodies.size() - 1;
    for (int substep = 0; substep < substeps; ++substep) {
        const std::size_t row = static_cast<std::size_t>(substep) * joints;
        const int count = parts();
        for (int part = 0; part < count && !m_exploded; ++part) {
            advance(targets + row, velocities + row, forces, torques, m_settings.time_step / btScalar(count));
        }
    }
}

bool Figure::touches(std::size_t body) const {
    for (int k = 0; k < m_dispatcher.getNumManifolds(); ++k) {
        const btPersistentManifold* manifold = m_dispatcher.getManifoldByIndexInternal(k);
        const btCollisionObject* collider = m_colliders[body].get();
        if (manifold->getBody0() != collider && manifold->getBody1() != collider) {
            continue;
        }
        for (int p = 0; p < manifold->getNumContacts(); ++p) {
            if (manifold->getContactPoint(p).getDistance() < btScalar(1e-3)) {
                return true;
            }
        }
    }
    return false;
}

void Figure::contact_forces(std::vector<btVector3>& out) const {
    std::fill(out.begin(), out.end(), btVector3(0, 0, 0));
    for (int k = 0; k < m_dispatcher.getNumManifolds(); ++k) {
        const btPersistentManifold* manifold = m_dispatcher.getManifoldByIndexInternal(k);
        btVector3 impulse(0, 0, 0);  // on body 0
        for (int p = 0; p < manifold->getNumContacts(); ++p) {
            const btManifoldPoint& point = manifold->getContactPoint(p);
            impulse += point.m_normalWorldOnB * point.m_appliedImpulse +
                       point.m_lateralFrictionDir1 * point.m_appliedImpulseLateral1 +
                       point.m_lateralFrictionDir2 * point.m_appliedImpulseLateral2;
        }
        for (std::size_t i = 0; i < m_colliders.size(); ++i) {
            if (manifold->getBody0() == m_colliders[i].get()) {
                out[i] += impulse / m_last_step;
            } else if (manifold->getBody1() == m_colliders[i].get()) {
                out[i] -= impulse / m_last_step;
            }
        }
    }
}
