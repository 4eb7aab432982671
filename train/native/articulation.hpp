// Forward dynamics of a figure by the articulated-body algorithm (Featherstone 2008, chapter 7), in world axes.
#pragma once

#include <vector>

#include "kinematics.hpp"

// A torque about the body's joint and a force, N m and N, or impulses of both.
struct Wrench {
    btVector3 torque, force;
};

// Accelerations, velocities or changes of velocity: angular, and linear of the joint's point.
struct Motion {
    btVector3 angular, linear;
};

// All joints are spherical: but for their motors, they pass a force on and no torque. What a subtree adds to the inertia of its parent is
// therefore a mass matrix at the joint, three by three, where the general algorithm has six by six.
class Articulation {
public:
    Articulation(const Description& bodies, bool fixed_root);

    // In this pose; `mass` is a factor for all masses and inertias.
    void update(const Kinematics& kinematics, btScalar mass);

    // The motions that wrenches cause at rest; a joint's torque acts on both of its bodies.
    void respond(const std::vector<Wrench>& wrenches, std::vector<Motion>& out);
    // The same with bias accelerations: those of each joint's point that velocities alone cause.
    void respond(const std::vector<Wrench>& wrenches, const std::vector<btVector3>& bias, std::vector<Motion>& out);

    // Of the tree from a body outwards, about its joint:
    // (torque, force) = [J H; H' M] (angular acceleration, acceleration of the joint's point).
    struct Body {
        int parent;
        btVector3 arm;       // from the parent's joint
        btMatrix3x3 J, H, M;
        btMatrix3x3 inverse;  // of J
        btMatrix3x3 coupling; // H' J^-1: a torque on the body pulls at the joint with minus this force
        btMatrix3x3 apparent; // M - H' J^-1 H: the apparent mass at the joint
    };
    const std::vector<Body>& bodies() const { return m_tree; }
    // The root's motion under a wrench about its joint.
    Motion root(const Wrench& wrench) const;

private:
    const Description& m_bodies;
    bool m_fixed;
    std::vector<Body> m_tree;
    std::vector<Wrench> m_wrenches;
    std::vector<btVector3> m_no_bias;
    btMatrix3x3 m_lever, m_turning, m_mass; // of the root: H M^-1, (J - H M^-1 H')^-1 and M^-1
};
