#include "obstacles.hpp"

namespace {

std::unique_ptr<btCollisionShape> shape_of(const Obstacle& item) {
    const btVector3 half = item.size * btScalar(0.5);
    std::unique_ptr<btCollisionShape> shape;
    switch (item.shape) {
        case Obstacle::Shape::sphere:
            // A sphere is its own collision margin.
            return std::make_unique<btSphereShape>(half.x());
        case Obstacle::Shape::box:
            shape = std::make_unique<btBoxShape>(half);
            break;
        case Obstacle::Shape::cylinder:
            shape = std::make_unique<btCylinderShapeZ>(btVector3(half.x(), half.x(), half.z()));
            break;
    }
    shape->setMargin(edge_margin);
    return shape;
}

} // namespace

void Obstacles::place(const std::vector<Obstacle>& items) {
    detach();
    m_bodies.clear();
    m_shapes.clear();
    m_items = items;
    for (const Obstacle& item : m_items) {
        m_shapes.push_back(shape_of(item));
        btVector3 inertia(0, 0, 0);
        if (item.mass > 0) {
            m_shapes.back()->calculateLocalInertia(item.mass, inertia);
        }
        m_bodies.push_back(std::make_unique<btRigidBody>(
            btRigidBody::btRigidBodyConstructionInfo(item.mass, nullptr, m_shapes.back().get(), inertia)));
        // Bullet multiplies the friction coefficients of two bodies: that of the pair is the figure's.
        m_bodies.back()->setFriction(1);
        m_bodies.back()->setActivationState(DISABLE_DEACTIVATION);
    }
    restart();
    attach();
}

void Obstacles::restart() {
    for (std::size_t k = 0; k < m_bodies.size(); ++k) {
        btRigidBody& body = *m_bodies[k];
        body.setLinearVelocity(m_items[k].velocity);
        body.setAngularVelocity(m_items[k].spin);
        body.clearForces();
        // Last, because it copies the velocities and also rotates the inertia.
        body.setCenterOfMassTransform(btTransform(m_items[k].rotation, m_items[k].position));
    }
}

void Obstacles::detach() {
    for (auto& body : m_bodies) {
        m_world.removeRigidBody(body.get());
    }
}

void Obstacles::attach() {
    for (auto& body : m_bodies) {
        m_world.addRigidBody(body.get(), Group::obstacle, Group::ground | Group::figure | Group::obstacle);
    }
}
