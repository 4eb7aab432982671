// Our dynamics of a figure that touches nothing movable: of its joints, and of its contacts.
#pragma once

#include <vector>

#include "BulletCollision/NarrowPhaseCollision/btPersistentManifold.h"
#include "BulletDynamics/Featherstone/btMultiBody.h"
#include "articulation.hpp"
#include "contacts.hpp"

// The equations are Bullet's. In world axes, with nothing but spherical joints, and with contacts that are reduced to
// the bodies that touch something, they take a fraction of the time.
class Dynamics {
public:
    // The kinematics must be those of `multi` at the beginning of every step.
    Dynamics(const Description& bodies, const WorldSettings& settings, const Kinematics& kinematics);
    Dynamics(const Dynamics&) = delete;
    Dynamics& operator=(const Dynamics&) = delete;

    void set_body(btMultiBody& multi) { m_multi = &multi; }
    // The factor of all masses and inertias.
    void set_mass(btScalar mass) { m_mass = mass; }

    // Change the velocities by all forces but those of contacts.
    void accelerate(btScalar time_step);
    // Add the effect of contacts to the changes of velocity that Bullet makes before it moves the bodies.
    void resolve(btPersistentManifold** manifolds, int count, const btContactSolverInfo& info);

private:
    const Description& m_bodies;
    const Kinematics& m_kinematics;
    Articulation m_articulation;
    Contacts m_contacts;
    btMultiBody* m_multi = nullptr;
    btScalar m_mass = 1;
    std::vector<Wrench> m_wrenches;
    std::vector<btVector3> m_bias; // accelerations of the joints' points that velocities alone cause
    std::vector<Motion> m_motions, m_answer;
    std::vector<btScalar> m_coordinates;

    void collect();
    void express(const std::vector<Motion>& motions);
    void add_points(btPersistentManifold& manifold);
};
