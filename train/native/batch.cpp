#include "batch.hpp"

#include <algorithm>
#include <utility>

namespace {

btVector3 vector(const double* v) {
    return btVector3(btScalar(v[0]), btScalar(v[1]), btScalar(v[2]));
}

btQuaternion quaternion(const double* q) {
    return btQuaternion(btScalar(q[0]), btScalar(q[1]), btScalar(q[2]), btScalar(q[3]));
}

template <typename V> void write(double* out, const V& value, int count) {
    for (int k = 0; k < count; ++k) {
        out[k] = static_cast<double>(value[k]);
    }
}

} // namespace

Batch::Batch(int size, Description bodies, const WorldSettings& settings, int threads)
    : positions(static_cast<std::size_t>(size) * bodies.size() * 3),
      rotations(static_cast<std::size_t>(size) * bodies.size() * 4),
      linear(static_cast<std::size_t>(size) * bodies.size() * 3),
      angular(static_cast<std::size_t>(size) * bodies.size() * 3),
      peaks(static_cast<std::size_t>(size) * (bodies.size() - 1)),
      exploded(static_cast<std::size_t>(size)),
      m_bodies(std::move(bodies)),
      m_pool(std::min(threads, size)) {
    for (int k = 0; k < size; ++k) {
        m_figures.push_back(std::make_unique<Figure>(m_bodies, settings));
        publish(k);
    }
}

void Batch::publish(int index) {
    const std::size_t count = m_bodies.size();
    const Figure& figure = *m_figures[static_cast<std::size_t>(index)];
    const Kinematics& k = figure.kinematics();
    for (std::size_t i = 0; i < count; ++i) {
        const std::size_t row = static_cast<std::size_t>(index) * count + i;
        write(&positions[3 * row], k.center[i], 3);
        write(&rotations[4 * row], k.quaternion[i], 4);
        write(&linear[3 * row], k.linear[i], 3);
        write(&angular[3 * row], k.angular[i], 3);
        if (i > 0) {
            peaks[static_cast<std::size_t>(index) * (count - 1) + i - 1] = static_cast<double>(figure.peaks()[i]);
        }
    }
    exploded[static_cast<std::size_t>(index)] = figure.exploded();
}

void Batch::vary(int index, double friction, double mass) {
    m_figures[static_cast<std::size_t>(index)]->vary(btScalar(friction), btScalar(mass));
}

void Batch::freeze(int index) { m_figures[static_cast<std::size_t>(index)]->freeze(); }

void Batch::reset(const std::vector<int>& indices, const Poses& poses) {
    const std::size_t joints = m_bodies.size() - 1;
    m_pool.run(static_cast<int>(indices.size()), [&](int task) {
        const std::size_t row = static_cast<std::size_t>(task);
        State state(m_bodies.size());
        state.position = vector(poses.root + 3 * row);
        state.rotation = quaternion(poses.rotation + 4 * row).normalized();
        state.linear = vector(poses.linear + 3 * row);
        state.angular = vector(poses.angular + 3 * row);
        for (std::size_t j = 0; j < joints; ++j) {
            state.joints[j + 1] = quaternion(poses.joints + 4 * (row * joints + j)).normalized();
            state.velocities[j + 1] = vector(poses.velocities + 3 * (row * joints + j));
        }
        m_figures[static_cast<std::size_t>(indices[row])]->reset(state);
        publish(indices[row]);
    });
}

void Batch::step(const double* targets, const double* velocities, const double* wrenches, int substeps) {
    const std::size_t count = m_bodies.size();
    const std::size_t rows = static_cast<std::size_t>(substeps) * (count - 1);
    m_targets.resize(m_figures.size() * rows);
    m_velocities.resize(m_figures.size() * rows);
    m_forces.resize(m_figures.size() * count);
    m_torques.resize(m_figures.size() * count);
    m_pool.run(size(), [&](int index) {
        const std::size_t first = static_cast<std::size_t>(index) * rows;
        for (std::size_t k = first; k < first + rows; ++k) {
            m_targets[k] = quaternion(targets + 4 * k);
            m_velocities[k] = vector(velocities + 3 * k);
        }
        const std::size_t body = static_cast<std::size_t>(index) * count;
        if (wrenches != nullptr) {
            for (std::size_t k = body; k < body + count; ++k) {
                m_forces[k] = vector(wrenches + 6 * k);
                m_torques[k] = vector(wrenches + 6 * k + 3);
            }
        }
        m_figures[static_cast<std::size_t>(index)]->step(&m_targets[first], &m_velocities[first], substeps,
                                                         wrenches != nullptr ? &m_forces[body] : nullptr,
                                                         wrenches != nullptr ? &m_torques[body] : nullptr);
        publish(index);
    });
}

void Batch::place(int index, const std::vector<Obstacle>& obstacles) {
    m_figures[static_cast<std::size_t>(index)]->obstacles().place(obstacles);
}

std::vector<double> Batch::obstacles(int index) const {
    const auto& items = std::as_const(*m_figures[static_cast<std::size_t>(index)]).obstacles().bodies();
    std::vector<double> out(items.size() * 13);
    for (std::size_t k = 0; k < items.size(); ++k) {
        write(&out[13 * k], items[k]->getWorldTransform().getOrigin(), 3);
        write(&out[13 * k + 3], items[k]->getWorldTransform().getRotation(), 4);
        write(&out[13 * k + 7], items[k]->getLinearVelocity(), 3);
        write(&out[13 * k + 10], items[k]->getAngularVelocity(), 3);
    }
    return out;
}

std::vector<unsigned char> Batch::touching() const {
    std::vector<unsigned char> out;
    for (const auto& figure : m_figures) {
        for (std::size_t i = 0; i < m_bodies.size(); ++i) {
            out.push_back(figure->touches(i));
        }
    }
    return out;
}

std::vector<double> Batch::contact_forces() const {
    std::vector<double> out(m_figures.size() * m_bodies.size() * 3);
    std::vector<btVector3> forces(m_bodies.size());
    for (std::size_t f = 0; f < m_figures.size(); ++f) {
        m_figures[f]->contact_forces(forces);
        for (std::size_t i = 0; i < forces.size(); ++i) {
            write(&out[3 * (f * forces.size() + i)], forces[i], 3);
        }
    }
    return out;
}
