// Stable proportional-derivative control (Tan, Liu & Turk 2011): the torque that the PD law will have at the end
// of a time step, which stays stable at gains with which the plain law explodes.
#pragma once

#include <vector>

#include "kinematics.hpp"

class StablePd {
public:
    StablePd(const Description& bodies, const WorldSettings& settings);

    void set_time_step(btScalar seconds) { m_step = seconds; }

    // Torques about each joint in the child's frame, every component within the joint's limit, for targets at
    // the end of the step:
    //   (M + dt Kd) a = Kp (target - q - dt v) + Kd (target velocity - v) - C
    //   torque = Kp (target - q - dt v) + Kd (target velocity - v - dt a)
    // The articulated-body algorithm (Featherstone 2008, chapter 7) gives `a` in O(n): dt Kd acts as an additional
    // inertia of every joint. External forces are not predicted. Gravity need not be: a free figure falls as a whole,
    // regardless of its joints.
    void torques(const State& state, const Kinematics& kinematics, const btQuaternion* targets,
                 const btVector3* target_velocities, std::vector<btVector3>& out);

private:
    // The articulated inertia of the tree from a body outwards, about its joint, in world axes:
    // (torque, force) = [J H; H' M] (angular acceleration, acceleration of the joint's point) + (torque, force).
    struct Articulated {
        btMatrix3x3 J, H, M;
        btVector3 torque, force;
    };
    struct Joint {
        btVector3 law;       // the PD law without its prediction of the acceleration
        btVector3 arm;       // from the parent's joint
        btVector3 spin, pull; // accelerations, angular and linear, due to velocities alone
        btMatrix3x3 inverse; // of J + dt Kd
        btVector3 angular, linear;
    };
    const Description& m_bodies;
    btScalar m_step;
    btScalar m_gravity;
    bool m_fixed;
    std::vector<Articulated> m_tree;
    std::vector<Joint> m_joints;

    void collect(const State& state, const Kinematics& k, const btQuaternion* targets, const btVector3* velocities);
    void reduce(std::size_t body);
    void root();
};
