// Description of a figure and its world, with the same numbers as the URDF. Z is up, X forward.
#pragma once

#include <vector>

#include "LinearMath/btQuaternion.h"
#include "LinearMath/btVector3.h"

struct Body {
    enum class Shape { box, sphere, capsule }; // a capsule lies along Z

    int parent;                // -1 for the root, which comes first; parents come before their children
    Shape shape;
    btVector3 size;            // outer dimensions, m
    btScalar mass;             // kg
    btVector3 inertia;         // principal moments about the centre of mass, kg m^2
    btVector3 control_inertia; // the same, as assumed by the controller
    btVector3 center;          // centre of mass from the body's joint, m
    btVector3 joint;           // the joint from the parent's joint, m
    btScalar stiffness;        // N m / rad
    btScalar damping;          // N m s / rad
    btScalar torque_limit;     // N m, of each component
};

using Description = std::vector<Body>;

struct WorldSettings {
    btScalar time_step; // s
    btScalar gravity;   // m/s^2, downwards
    btScalar friction;  // default, between a figure and everything it touches
    int iterations;     // of the contact solver
    btScalar contact_erp; // share of a penetration that one step corrects
    btScalar fastest;      // m/s: a faster body has exploded
    btScalar free_speed;   // rad/s, m/s: Bullet's own limit of the coordinates' speeds
    btScalar largest_turn; // rad: a step in which a joint would turn further is divided ...
    int most_parts;        // ... into this many parts at most
    bool fixed_root;    // the root stays in its initial pose
};

struct Obstacle {
    enum class Shape { box, sphere, cylinder }; // a cylinder lies along Z

    Shape shape;
    btVector3 size;     // outer dimensions, m
    btScalar mass;      // kg; 0 for a static obstacle
    btVector3 position; // of the centre, m
    btQuaternion rotation;
    btVector3 velocity; // m/s, at the figure's reset
    btVector3 spin;     // rad/s, at the figure's reset
};
