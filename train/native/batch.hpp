// E figures (humanoids), stepped in parallel on a pool of threads; their states are in arrays with fixed addresses.
#pragma once

#include <memory>
#include <vector>

#include "figure.hpp"
#include "thread_pool.hpp"

class Batch {
public:
    Batch(int size, Description bodies, const WorldSettings& settings, int threads);

    int size() const { return static_cast<int>(m_figures.size()); }
    int bodies() const { return static_cast<int>(m_bodies.size()); }

    // Applies to one figure, from its next reset on: see Figure::vary.
    void vary(int index, double friction, double mass);

    // Arguments of a reset, one row for each of `indices`: root (3) and its rotation (4), linear (3) and angular (3)
    // velocity, then rotations (joints, 4) and velocities (joints, 3) of the joints.
    struct Poses {
        const double *root, *rotation, *linear, *angular, *joints, *velocities;
    };
    void reset(const std::vector<int>& indices, const Poses& poses);

    // See Figure::freeze.
    void freeze(int index);

    // targets: (E, substeps, joints, 4); velocities: (E, substeps, joints, 3); wrenches: (E, bodies, 6) or null.
    void step(const double* targets, const double* velocities, const double* wrenches, int substeps);

    void place(int index, const std::vector<Obstacle>& obstacles);
    // (K, 13): position, rotation, velocity and angular velocity of each obstacle of a figure.
    std::vector<double> obstacles(int index) const;

    // (E, bodies, 3 or 4), updated by `reset` and `step`.
    std::vector<double> positions, rotations, linear, angular;
    std::vector<double> peaks;           // (E, joints): largest torque in the last step, N m
    std::vector<unsigned char> exploded; // (E,)

    std::vector<unsigned char> touching() const;   // (E, bodies)
    std::vector<double> contact_forces() const;    // (E, bodies, 3)

private:
    const Description m_bodies;
    std::vector<std::unique_ptr<Figure>> m_figures;
    // Inputs of each figure, in Bullet's types.
    std::vector<btQuaternion> m_targets;
    std::vector<btVector3> m_velocities, m_forces, m_torques;
    ThreadPool m_pool;

    void publish(int index);
};
