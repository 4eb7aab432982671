// The Python module `kinemimic_native`: one class, `Batch`.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstdint>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "batch.hpp"

namespace py = pybind11;

namespace {

using Floats = py::array_t<double, py::array::c_style | py::array::forcecast>;
// No truncation: floats are refused, as numpy refuses them for an index.
using Integers = py::array_t<std::int64_t, py::array::c_style>;

std::string text(const std::vector<py::ssize_t>& shape) {
    std::ostringstream out;
    out << '(';
    for (std::size_t k = 0; k < shape.size(); ++k) {
        out << (k > 0 ? ", " : "") << shape[k];
    }
    out << ')';
    return out.str();
}

// The array's numbers, if it has this shape.
const double* checked(const char* name, const Floats& array, const std::vector<py::ssize_t>& shape) {
    const std::vector<py::ssize_t> found(array.shape(), array.shape() + array.ndim());
    if (found != shape) {
        throw std::invalid_argument(std::string(name) + ": expected the shape " + text(shape) + ", found " + text(found));
    }
    return array.data();
}

btVector3 vector(const double* v) {
    return btVector3(btScalar(v[0]), btScalar(v[1]), btScalar(v[2]));
}

Description description(const Integers& parents, const Integers& shapes, const Floats& sizes, const Floats& masses,
                        const Floats& inertias, const Floats& control_inertias, const Floats& centers,
                        const Floats& joints, const Floats& stiffness, const Floats& damping,
                        const Floats& torque_limits) {
    const py::ssize_t count = parents.size();
    const double* size = checked("sizes", sizes, {count, 3});
    const double* mass = checked("masses", masses, {count});
    const double* inertia = checked("inertias", inertias, {count, 3});
    const double* control = checked("control_inertias", control_inertias, {count, 3});
    const double* center = checked("centers", centers, {count, 3});
    const double* joint = checked("joints", joints, {count, 3});
    const double* kp = checked("stiffness", stiffness, {count});
    const double* kd = checked("damping", damping, {count});
    const double* limit = checked("torque_limits", torque_limits, {count});
    if (count < 2 || shapes.size() != count) {
        throw std::invalid_argument("expected at least two bodies, each with a parent and a shape");
    }
    Description bodies;
    for (py::ssize_t i = 0; i < count; ++i) {
        const std::int64_t parent = parents.at(i);
        if (i == 0 ? parent != -1 : parent < 0 || parent >= i) {
            throw std::invalid_argument("parents: expected -1 for the first body and an earlier one for every other");
        }
        if (shapes.at(i) < 0 || shapes.at(i) > 2) {
            throw std::invalid_argument("shapes: expected 0 (box), 1 (sphere) or 2 (capsule)");
        }
        bodies.push_back({static_cast<int>(parent), static_cast<Body::Shape>(shapes.at(i)), vector(size + 3 * i), btScalar(mass[i]),
                          vector(inertia + 3 * i), vector(control + 3 * i), vector(center + 3 * i),
                          vector(joint + 3 * i), btScalar(kp[i]), btScalar(kd[i]), btScalar(limit[i])});
    }
    return bodies;
}

std::unique_ptr<Batch> make(int size, const Integers& parents, const Integers& shapes, const Floats& sizes,
                            const Floats& masses, const Floats& inertias, const Floats& control_inertias,
                            const Floats& centers, const Floats& joints, const Floats& stiffness,
                            const Floats& damping, const Floats& torque_limits, double time_step, double gravity,
                            double friction, int iterations, double contact_erp, double fastest, double free_speed,
                            double largest_turn, int most_parts, int threads, bool fixed_root) {
    if (size < 1 || threads < 1 || iterations < 1 || most_parts < 1 || !(time_step > 0) || !(largest_turn > 0)) {
        throw std::invalid_argument("expected size, threads, iterations, most_parts, time_step, largest_turn above 0");
    }
    const WorldSettings settings{btScalar(time_step), btScalar(gravity), btScalar(friction), iterations, btScalar(contact_erp),
                                 btScalar(fastest), btScalar(free_speed), btScalar(largest_turn), most_parts, fixed_root};
    return std::make_unique<Batch>(size,
                                   description(parents, shapes, sizes, masses, inertias, control_inertias, centers,
                                               joints, stiffness, damping, torque_limits),
                                   settings, threads);
}

int index_in(const Batch& batch, std::int64_t index) {
    if (index < 0 || index >= batch.size()) {
        throw std::out_of_range("expected an index below " + std::to_string(batch.size()) + ", found " +
                                std::to_string(index));
    }
    return static_cast<int>(index);
}

void vary(Batch& batch, const Integers& indices, const Floats& friction, const Floats& mass) {
    const py::ssize_t count = indices.size();
    const double* frictions = checked("friction", friction, {count});
    const double* masses = checked("mass", mass, {count});
    std::vector<int> rows;
    for (py::ssize_t k = 0; k < count; ++k) {
        rows.push_back(index_in(batch, indices.at(k)));
    }
    for (std::size_t k = 0; k < rows.size(); ++k) {
        batch.vary(rows[k], frictions[k], masses[k]);
    }
}

void reset(Batch& batch, const Integers& indices, const Floats& root, const Floats& rotation, const Floats& linear,
           const Floats& angular, const Floats& joints, const Floats& velocities) {
    const py::ssize_t count = indices.size(), others = batch.bodies() - 1;
    const Batch::Poses poses{checked("root", root, {count, 3}),
                             checked("rotation", rotation, {count, 4}),
                             checked("linear", linear, {count, 3}),
                             checked("angular", angular, {count, 3}),
                             checked("joints", joints, {count, others, 4}),
                             checked("velocities", velocities, {count, others, 3})};
    std::vector<int> rows;
    std::vector<bool> seen(static_cast<std::size_t>(batch.size()));
    for (py::ssize_t k = 0; k < count; ++k) {
        rows.push_back(index_in(batch, indices.at(k)));
        // Two threads must not reset the same figure.
        if (seen[static_cast<std::size_t>(rows.back())]) {
            throw std::invalid_argument("indices: expected every figure once");
        }
        seen[static_cast<std::size_t>(rows.back())] = true;
    }
    const py::gil_scoped_release release;
    batch.reset(rows, poses);
}

void freeze(Batch& batch, const Integers& indices) {
    for (py::ssize_t k = 0; k < indices.size(); ++k) {
        batch.freeze(index_in(batch, indices.at(k)));
    }
}

void step(Batch& batch, const Floats& targets, const Floats& velocities, const std::optional<Floats>& wrenches) {
    const py::ssize_t size = batch.size(), others = batch.bodies() - 1;
    const py::ssize_t substeps = targets.ndim() > 1 ? targets.shape(1) : 0;
    if (substeps < 1) {
        throw std::invalid_argument("targets: expected the shape (figures, substeps, joints, 4)");
    }
    const double* target = checked("targets", targets, {size, substeps, others, 4});
    const double* velocity = checked("velocities", velocities, {size, substeps, others, 3});
    const double* wrench =
        wrenches ? checked("wrenches", *wrenches, {size, static_cast<py::ssize_t>(batch.bodies()), 6}) : nullptr;
    const py::gil_scoped_release release;
    batch.step(target, velocity, wrench, static_cast<int>(substeps));
}

void place(Batch& batch, int index, const Integers& shapes, const Floats& sizes, const Floats& masses,
           const Floats& positions, const Floats& rotations, const Floats& velocities, const Floats& spins) {
    const py::ssize_t count = shapes.size();
    const double* size = checked("sizes", sizes, {count, 3});
    const double* mass = checked("masses", masses, {count});
    const double* position = checked("positions", positions, {count, 3});
    const double* rotation = checked("rotations", rotations, {count, 4});
    const double* velocity = checked("velocities", velocities, {count, 3});
    const double* spin = checked("spins", spins, {count, 3});
    std::vector<Obstacle> items;
    for (py::ssize_t k = 0; k < count; ++k) {
        if (shapes.at(k) < 0 || shapes.at(k) > 2) {
            throw std::invalid_argument("shapes: expected 0 (box), 1 (sphere) or 2 (cylinder)");
        }
        const double* q = rotation + 4 * k;
        items.push_back({static_cast<Obstacle::Shape>(shapes.at(k)), vector(size + 3 * k), btScalar(mass[k]),
                         vector(position + 3 * k),
                         btQuaternion(btScalar(q[0]), btScalar(q[1]), btScalar(q[2]), btScalar(q[3])),
                         vector(velocity + 3 * k), vector(spin + 3 * k)});
    }
    batch.place(index_in(batch, index), items);
}

// A view of the batch's memory; it keeps the batch alive.
template <typename T> py::array window(py::object self, std::vector<T>& values, std::vector<py::ssize_t> shape) {
    py::array_t<T> array(shape, values.data(), self);
    array.attr("flags").attr("writeable") = false;
    return array;
}

// The same bytes, as numpy's bool.
py::array truths(py::array bytes) { return bytes.attr("view")("bool"); }

template <typename T> py::array copied(const std::vector<T>& values, std::vector<py::ssize_t> shape) {
    return py::array_t<T>(shape, values.data());
}

Batch& of(const py::object& self) { return self.cast<Batch&>(); }

} // namespace

PYBIND11_MODULE(kinemimic_native, m) {
    m.doc() = "Batches of humanoids in Bullet, with our own dynamics, contacts and stable PD control.";
    // Increased whenever arguments or results change; train/sim/engines.py accepts only this number.
    m.attr("interface") = 6;
    m.attr("double_precision") = sizeof(btScalar) == sizeof(double);
    py::class_<Batch>(m, "Batch", "E figures, each alone in its Bullet world. See train/sim/native_world.py.")
        .def(py::init(&make), py::kw_only(), py::arg("size"), py::arg("parents"), py::arg("shapes"), py::arg("sizes"),
             py::arg("masses"), py::arg("inertias"), py::arg("control_inertias"), py::arg("centers"),
             py::arg("joints"), py::arg("stiffness"), py::arg("damping"), py::arg("torque_limits"),
             py::arg("time_step"), py::arg("gravity"), py::arg("friction"), py::arg("iterations"), py::arg("contact_erp"), py::arg("fastest"),
             py::arg("free_speed"), py::arg("largest_turn"), py::arg("most_parts"), py::arg("threads"), py::arg("fixed_root") = false)
        .def("vary", &vary, py::arg("indices"), py::arg("friction"), py::arg("mass"))
        .def("reset", &reset, py::arg("indices"), py::arg("root"), py::arg("rotation"), py::arg("linear"),
             py::arg("angular"), py::arg("joints"), py::arg("velocities"))
        .def("freeze", &freeze, py::arg("indices"))
        .def("step", &step, py::arg("targets"), py::arg("velocities"), py::arg("wrenches") = py::none())
        .def("place", &place, py::arg("index"), py::kw_only(), py::arg("shapes"), py::arg("sizes"), py::arg("masses"),
             py::arg("positions"), py::arg("rotations"), py::arg("velocities"), py::arg("spins"))
        .def("obstacles",
             [](const Batch& batch, int index) {
                 const std::vector<double> values = batch.obstacles(index_in(batch, index));
                 return copied(values, {static_cast<py::ssize_t>(values.size() / 13), 13});
             })
        .def("touching",
             [](const Batch& batch) { return truths(copied(batch.touching(), {batch.size(), batch.bodies()})); })
        .def("contact_forces",
             [](const Batch& batch) { return copied(batch.contact_forces(), {batch.size(), batch.bodies(), 3}); })
        .def_property_readonly("positions", [](py::object s) { return window(s, of(s).positions, {of(s).size(), of(s).bodies(), 3}); })
        .def_property_readonly("rotations", [](py::object s) { return window(s, of(s).rotations, {of(s).size(), of(s).bodies(), 4}); })
        .def_property_readonly("linear", [](py::object s) { return window(s, of(s).linear, {of(s).size(), of(s).bodies(), 3}); })
        .def_property_readonly("angular", [](py::object s) { return window(s, of(s).angular, {of(s).size(), of(s).bodies(), 3}); })
        .def_property_readonly("peaks", [](py::object s) { return window(s, of(s).peaks, {of(s).size(), of(s).bodies() - 1}); })
        .def_property_readonly("exploded", [](py::object s) { return truths(window(s, of(s).exploded, {of(s).size()})); });
}
