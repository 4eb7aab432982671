#include "world.hpp"

namespace {

bool is_figure(const btCollisionObject* object) {
    return object->getInternalType() == btCollisionObject::CO_FEATHERSTONE_LINK;
}

} // namespace

void ContactSolver::solveMultiBodyGroup(btCollisionObject** objects, int object_count,
                                        btPersistentManifold** manifolds, int manifold_count,
                                        btTypedConstraint** constraints, int constraint_count,
                                        btMultiBodyConstraint** joints, int joint_count,
                                        const btContactSolverInfo& info, btIDebugDraw* drawer,
                                        btDispatcher* dispatcher) {
    // Bullet may collect islands, but not those with manifolds, and the plane of the ground has one with every body of
    // the figure: its island comes alone.
    if (apart && (object_count == 0 || is_figure(objects[0]))) {
        m_dynamics.resolve(manifolds, manifold_count, info);
        return;
    }
    btMultiBodyConstraintSolver::solveMultiBodyGroup(objects, object_count, manifolds, manifold_count, constraints,
                                                     constraint_count, joints, joint_count, info, drawer, dispatcher);
}

World::World(btDispatcher& dispatcher, btBroadphaseInterface& broadphase, ContactSolver& solver,
             btCollisionConfiguration& configuration, Dynamics& dynamics)
    : btMultiBodyDynamicsWorld(&dispatcher, &broadphase, &solver, &configuration),
      m_solver(solver),
      m_dynamics(dynamics) {}

// Predicted link positions are needed only for swept collisions, which are not used here.
void World::predictUnconstraintMotion(btScalar time_step) {
    btDiscreteDynamicsWorld::predictUnconstraintMotion(time_step);
}

// Bullet solves together for all bodies whose bounding boxes overlap, except through those that do not move.
bool World::is_apart() {
    const btBroadphasePairArray& pairs = getPairCache()->getOverlappingPairArray();
    for (int k = 0; k < pairs.size(); ++k) {
        const auto* first = static_cast<const btCollisionObject*>(pairs[k].m_pProxy0->m_clientObject);
        const auto* second = static_cast<const btCollisionObject*>(pairs[k].m_pProxy1->m_clientObject);
        if (is_figure(first) != is_figure(second) &&
            !(is_figure(first) ? second : first)->isStaticOrKinematicObject()) {
            return false;
        }
    }
    return true;
}

void World::solveExternalForces(btContactSolverInfo& info) {
    m_solver.apart = is_apart();
    if (!m_solver.apart) {
        btMultiBodyDynamicsWorld::solveExternalForces(info);
        return;
    }
    m_solverMultiBodyIslandCallback->setup(&info, nullptr, 0, nullptr, 0, nullptr);
    m_dynamics.accelerate(info.m_timeStep);
}
