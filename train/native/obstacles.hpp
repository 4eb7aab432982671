// What stands in a figure's way or is thrown at it: rigid bodies of its world.
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

// Sharp shapes keep their size and round their edges by this much, m, as the pybullet wheel has it.
constexpr btScalar edge_margin = btScalar(0.001);

class Obstacles {
public:
    explicit Obstacles(btDiscreteDynamicsWorld& world) : m_world(world) {}
    ~Obstacles() { detach(); }
    Obstacles(const Obstacles&) = delete;
    Obstacles& operator=(const Obstacles&) = delete;

    // Replaces all of them; they stand at their start.
    void place(const std::vector<Obstacle>& items);
    // Back to where and how they began.
    void restart();
    // Out of the world, and in again.
    void detach();
    void attach();

    const std::vector<std::unique_ptr<btRigidBody>>& bodies() const { return m_bodies; }

private:
    btDiscreteDynamicsWorld& m_world;
    std::vector<Obstacle> m_items;
    std::vector<std::unique_ptr<btCollisionShape>> m_shapes;
    std::vector<std::unique_ptr<btRigidBody>> m_bodies;
};
