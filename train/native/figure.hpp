// One humanoid, alone with its ground and its obstacles in its own Bullet world.
#pragma once

#include <memory>
#include <vector>

#include "BulletDynamics/Featherstone/btMultiBody.h"
#include "BulletDynamics/Featherstone/btMultiBodyLinkCollider.h"
#include "kinematics.hpp"
#include "obstacles.hpp"
#include "stable_pd.hpp"
#include "world.hpp"

class Figure {
public:
    Figure(const Description& bodies, const WorldSettings& settings);
    ~Figure();
    Figure(const Figure&) = delete;
    Figure& operator=(const Figure&) = delete;

    // Takes effect at the next reset: friction with everything, and the factor for all masses and inertias. The
    // controller keeps assuming those of the description.
    void vary(btScalar friction, btScalar mass) {
        m_friction = friction;
        m_mass = mass;
    }

    // Clears the previous state completely, bit for bit: contacts, warm starts and obstacles start afresh.
    void reset(const State& state);

    // Physics steps towards `targets` (substeps x joints). The pushes (a force and a torque per body, N and N m, in the
    // world, at its centre of mass; may be null) act during all of them.
    void step(const btQuaternion* targets, const btVector3* velocities, int substeps, const btVector3* forces,
              const btVector3* torques);

    // Steps change nothing any more, until the next reset.
    void freeze() { m_frozen = true; }

    const Kinematics& kinematics() const { return m_kinematics; }
    // Largest component of each joint's torque in the last `step`, N m; [0] unused.
    const std::vector<btScalar>& peaks() const { return m_peaks; }
    // The state became invalid: infinite, NaN or too fast. The figure keeps its last valid state, touching nothing,
    // until its reset.
    bool exploded() const { return m_exploded; }
    bool touches(std::size_t body) const;
    // Force of all contacts on each body in the last physics step, N, in the world.
    void contact_forces(std::vector<btVector3>& out) const;
    // They return to their initial state at every reset.
    Obstacles& obstacles() { return m_obstacles; }
    const Obstacles& obstacles() const { return m_obstacles; }

private:
    const Description& m_bodies;
    const WorldSettings m_settings;
    State m_state;
    Kinematics m_kinematics;
    Dynamics m_dynamics;
    // Bullet keeps raw pointers to all of these: members used by others come first and are destroyed last.
    btDefaultCollisionConfiguration m_configuration{small_pools()};
    btCollisionDispatcher m_dispatcher;
    btDbvtBroadphase m_broadphase;
    ContactSolver m_solver;
    std::vector<std::unique_ptr<btCollisionShape>> m_shapes;
    World m_world;
    std::unique_ptr<btRigidBody> m_ground;
    std::unique_ptr<btMultiBody> m_multi;
    std::vector<std::unique_ptr<btMultiBodyLinkCollider>> m_colliders;
    Obstacles m_obstacles;

    StablePd m_control;
    std::vector<btVector3> m_torques;
    std::vector<btScalar> m_peaks;
    bool m_exploded = false;
    bool m_frozen = false;
    btScalar m_last_step;
    btScalar m_friction;
    btScalar m_mass = 1;

    static btDefaultCollisionConstructionInfo small_pools();
    void build();
    void embody();
    int parts() const;
    void advance(const btQuaternion* targets, const btVector3* velocities, const btVector3* forces,
                 const btVector3* torques, btScalar time_step);
    void write(const State& state);
    void read();
    bool sound() const;
    void forget_contacts();
};
