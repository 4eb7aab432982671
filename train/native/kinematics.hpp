// Generalised coordinates of a figure, and the resulting positions of its bodies.
#pragma once

#include <vector>

#include "LinearMath/btMatrix3x3.h"
#include "LinearMath/btQuaternion.h"
#include "description.hpp"

// Root in the world, joints in the child's frame. Entry 0 of the joints is unused: the root has none.
struct State {
    btVector3 position;  // of the root's centre of mass, m
    btQuaternion rotation;
    btVector3 linear, angular;
    std::vector<btQuaternion> joints;  // child to parent
    std::vector<btVector3> velocities; // rad/s

    explicit State(std::size_t bodies);
};

// All bodies in the world.
struct Kinematics {
    std::vector<btMatrix3x3> rotation;
    std::vector<btQuaternion> quaternion;
    std::vector<btVector3> joint;    // origin of the joint that carries the body, m
    std::vector<btVector3> center;   // centre of mass, m
    std::vector<btVector3> angular;  // rad/s
    std::vector<btVector3> linear;   // of the centre of mass, m/s
    std::vector<btVector3> relative; // angular velocity across the joint, rad/s

    explicit Kinematics(std::size_t bodies);
    void update(const Description& bodies, const State& state);
};
