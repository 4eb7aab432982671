// Bullet's world of one figure, which leaves the figure to our dynamics while it is away from movable obstacles.
#pragma once

#include "BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h"
#include "BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h"
#include "dynamics.hpp"

class ContactSolver : public btMultiBodyConstraintSolver {
public:
    explicit ContactSolver(Dynamics& dynamics) : m_dynamics(dynamics) {}
    // Whether the figure is away from movable obstacles in this step.
    bool apart = false;

    void solveMultiBodyGroup(btCollisionObject** objects, int object_count, btPersistentManifold** manifolds,
                             int manifold_count, btTypedConstraint** constraints, int constraint_count,
                             btMultiBodyConstraint** joints, int joint_count, const btContactSolverInfo& info,
                             btIDebugDraw* drawer, btDispatcher* dispatcher) override;

private:
    Dynamics& m_dynamics;
};

class World : public btMultiBodyDynamicsWorld {
public:
    World(btDispatcher& dispatcher, btBroadphaseInterface& broadphase, ContactSolver& solver,
          btCollisionConfiguration& configuration, Dynamics& dynamics);

protected:
    void predictUnconstraintMotion(btScalar time_step) override;
    void solveExternalForces(btContactSolverInfo& info) override;

private:
    ContactSolver& m_solver;
    Dynamics& m_dynamics;

    bool is_apart();
};
