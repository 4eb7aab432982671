// Contacts of one figure with bodies that do not move: Bullet's own sequential impulses, at a fraction of the cost.
#pragma once

#include <vector>

#include "BulletCollision/NarrowPhaseCollision/btManifoldPoint.h"
#include "BulletDynamics/ConstraintSolver/btContactSolverInfo.h"
#include "articulation.hpp"
#include "columns.hpp"

// The equations, the order of the contacts and the end of the iterations are those of btMultiBodyConstraintSolver,
// so that the results agree up to rounding. For each direction of each contact, Bullet computes the changes of all
// joints' velocities that a unit impulse causes, and it updates all of them after each impulse. Here, only bodies with
// contacts are followed, each with the six components of its motion, and the joints are updated once, at the end.
class Contacts {
public:
    explicit Contacts(Articulation& articulation) : m_articulation(articulation) {}

    // Removes all contacts of the last step.
    void clear();
    // A contact of a body; `side` is 1 if the body is the manifold's first, -1 if it is the second.
    void add(std::size_t body, btScalar side, btManifoldPoint& point, const Kinematics& kinematics);
    bool empty() const { return m_points.empty(); }

    // The changes of all bodies' velocities, given those without the contacts. Stores the impulses in the contact
    // points.
    void solve(const std::vector<Motion>& velocities, const btContactSolverInfo& info, std::vector<Motion>& out);

private:
    struct Response {
        Columns angular, linear;
    };
    // One direction of a contact: the normal, then the two of friction.
    struct Row {
        std::size_t body;   // among those with contacts
        btScalar wrench[6]; // that a unit impulse exerts on the body: a torque about its joint and a force
        btScalar inverse;   // of the velocity that a unit impulse causes in its own direction
        btScalar target;    // the impulse that would be right if there were no others
        btScalar impulse;
    };

    Articulation& m_articulation;
    std::vector<btManifoldPoint*> m_points;
    std::vector<Row> m_rows;
    std::vector<std::size_t> m_touching; // bodies with contacts
    std::vector<char> m_needed;          // whether a body is one of these, or between one and the root
    std::vector<Response> m_columns;     // of every needed body to six unit wrenches on one
    std::vector<Columns> m_torques;      // about its joint, due to the same
    // Six changes of velocity of each touching body: for each unit wrench on each, for each row, and in all.
    std::vector<btScalar> m_unit, m_responses, m_motion;
    std::vector<Wrench> m_wrenches;

    std::size_t stride() const { return 6 * m_touching.size(); }
    std::size_t index_of(std::size_t body);
    void respond(std::size_t touching);
    void prepare(const std::vector<Motion>& velocities, const btContactSolverInfo& info);
    btScalar correction(const Row& row) const;
    void apply(std::size_t row, btScalar impulse);
    btScalar iterate();
};
