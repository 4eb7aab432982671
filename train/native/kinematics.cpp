#include "kinematics.hpp"

State::State(std::size_t bodies)
    : position(0, 0, 0),
      rotation(0, 0, 0, 1),
      linear(0, 0, 0),
      angular(0, 0, 0),
      joints(bodies, btQuaternion(0, 0, 0, 1)),
      velocities(bodies, btVector3(0, 0, 0)) {}

Kinematics::Kinematics(std::size_t bodies)
    : rotation(bodies),
      quaternion(bodies),
      joint(bodies),
      center(bodies),
      angular(bodies),
      linear(bodies),
      relative(bodies, btVector3(0, 0, 0)) {}

void Kinematics::update(const Description& bodies, const State& state) {
    rotation[0].setRotation(state.rotation);
    quaternion[0] = state.rotation;
    center[0] = state.position;
    joint[0] = state.position - rotation[0] * bodies[0].center;
    angular[0] = state.angular;
    linear[0] = state.linear;
    for (std::size_t i = 1; i < bodies.size(); ++i) {
        const Body& body = bodies[i];
        const std::size_t p = static_cast<std::size_t>(body.parent);
        quaternion[i] = quaternion[p] * state.joints[i];
        rotation[i].setRotation(quaternion[i]);
        joint[i] = joint[p] + rotation[p] * body.joint;
        center[i] = joint[i] + rotation[i] * body.center;
        relative[i] = rotation[i] * state.velocities[i];
        angular[i] = angular[p] + relative[i];
        linear[i] = linear[p] + angular[p].cross(joint[i] - center[p]) + angular[i].cross(center[i] - joint[i]);
    }
}
