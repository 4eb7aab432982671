// Obstacles in a figure's way, or thrown at it: rigid bodies in its world.
#pragma once

#include <memory>
#include <vector>

#include "btBulletCollisionCommon.h"
#include "btBulletDynamicsCommon.h"
#include "description.hpp"

// Bits of the collision filter. A figure's bodies pass through each other.
namespace Group {
constexpr int ground = 1, figure = 2, obstacle = 4;
}

// Shapes with edges keep their size, and their edges are rounded by this much, m, as in the pybullet wheel.
constexpr btScalar edge_margin = btScalar(0.001);

class Obstacles {
public:
    explicit Obstacles(btDiscreteDynamicsWorld& world) : m_world(world) {}
    ~Obstacles() { detach(); }
    Obstacles(const Obstacles&) = delete;
    Obstacles& operator=(const Obstacles&) = delete;

    // Replaces all obstacles; they are in their initial state.
    void place(const std::vector<Obstacle>& items);
    // Back to the initial state.
    void restart();
    // Remove them from the world, and add them again.
    void detach();
    void attach();

    const std::vector<std::unique_ptr<btRigidBody>>& bodies() const { return m_bodies; }

private:
    btDiscreteDynamicsWorld& m_world;
    std::vector<Obstacle> m_items;
    std::vector<std::unique_ptr<btCollisionShape>> m_shapes;
    std::vector<std::unique_ptr<btRigidBody>> m_bodies;
};
