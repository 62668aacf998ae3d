// The module subworld_core: the whole system in this process, step by step, for Python.
#include "io/options/options.hpp"
#include "lab/session/coupled_run.hpp"
#include "lab/session/metrics.hpp"
#include "model/error.hpp"
#include "model/settings/settings.hpp"
#include "wire/observer.hpp"

#include <dlfcn.h>
#include <fmt/core.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace py = pybind11;

/// The programs lie in the folder above that of a build's modules, or in lib/subworld of an installation.
extern "C" const char* subworld_installed_programs() {
  static const std::string kFolder = [] {
    namespace fs = std::filesystem;
    Dl_info self{};
    dladdr(reinterpret_cast<void*>(&subworld_installed_programs), &self);
    const fs::path above = fs::canonical(self.dli_fname).parent_path().parent_path();
    return (exists(above / "world_sim") ? above : above.parent_path() / "subworld").string();
  }();
  return kFolder.c_str();
}

namespace {

using namespace subworld;
using namespace py::literals;
using Changes = std::map<std::string, py::object>;  ///< of settings, by their keys
using Array = py::array_t<double>;

/// A scheme whose correction is a function of Python. The rest is that of another scheme.
struct PythonScheme {
  std::string name, summary;
  const Scheme* base;
  py::function correct;
  Scheme scheme;
};
/// By name; never destroyed, because Python ends first.
std::map<std::string, PythonScheme, std::less<>>& python_schemes() {
  static auto* const all = new std::map<std::string, PythonScheme, std::less<>>;
  return *all;
}
py::object raised;  ///< by a correction; no exception may pass through the coupling

const char* name_of(Owner owner) { return owner == Owner::world ? "world" : owner == Owner::user ? "user" : "peer"; }

Correction correction_of(const CopyPair& pair, const Indicators&, const Settings& settings) noexcept {
  const PythonScheme& scheme = python_schemes().find(settings.scheme)->second;
  try {
    const auto [world, sub] = scheme.correct(name_of(pair.owner), pair.lag_cycles).cast<std::pair<double, double>>();
    if (!(world >= 0.0 && world <= 1.0 && sub >= 0.0 && sub <= 1.0))
      throw py::value_error(
          fmt::format("scheme {}: a correction is from 0 to 1, not ({}, {})", scheme.name, world, sub));
    return {world, sub};
  } catch (py::error_already_set& error) {
    raised = error.value();
  } catch (const py::cast_error&) {
    raised = py::module_::import("builtins")
                 .attr("TypeError")(
                     fmt::format("scheme {}: correction(owner, lag_cycles) must return two numbers", scheme.name));
  } catch (const std::exception& error) {
    raised = py::module_::import("builtins").attr("ValueError")(error.what());
  }
  return {};
}

void add_python_scheme(const std::string& name, py::function correct, const std::string& base) {
  Settings of_base;
  of_base.scheme = base;
  const Scheme& rest = scheme_of(of_base, "base");
  const auto [at, is_new] = python_schemes().try_emplace(name);
  if (!is_new) throw Error(ExitCode::usage, fmt::format("scheme \"{}\": there is one of this name already", name));
  PythonScheme& added = at->second;
  added = {name, fmt::format("{} with a correction in Python", base), &rest, std::move(correct), rest};
  added.scheme.properties.name = added.name;
  added.scheme.properties.summary = added.summary;
  added.scheme.correction = correction_of;
  try {
    add_scheme(added.scheme);
  } catch (const Error&) {
    python_schemes().erase(at);
    throw;
  }
}

Scene scene_of(const std::string& name, const Changes& settings, bool reference) {
  Options options;
  options.scene = name;
  for (const auto& [key, value] : settings) {
    // As YAML has it: true, not True.
    const bool is_bool = py::isinstance<py::bool_>(value);
    options.set.push_back(key + "=" +
                          (is_bool ? (value.cast<bool>() ? "true" : "false") : std::string(py::str(value))));
    if (const std::string fault = setting_fault(parse_change(options.set.back())); !fault.empty())
      throw Error(ExitCode::usage, fmt::format("{}: {}", options.set.back(), fault));
  }
  Scene scene = load_scene(options);
  return reference ? in_one_world(std::move(scene)) : scene;
}

Array rows(const std::vector<Vec3>& vectors) {
  Array made({vectors.size(), std::size_t{3}});
  auto at = made.mutable_unchecked<2>();
  for (std::size_t i = 0; i < vectors.size(); ++i)
    for (int k = 0; k < 3; ++k) at(static_cast<py::ssize_t>(i), k) = vectors[i][k];
  return made;
}

std::vector<Vec3> vectors(const py::array_t<double, py::array::c_style | py::array::forcecast>& rows) {
  if (rows.ndim() != 2 || rows.shape(1) != 3) throw py::value_error("forces are an array of n x 3");
  const auto at = rows.unchecked<2>();
  std::vector<Vec3> made;
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) made.emplace_back(at(i, 0), at(i, 1), at(i, 2));
  return made;
}

/// A run in lock-step, and its scene.
class InProcess {
 public:
  InProcess(const std::string& scene, const Changes& settings, bool reference)
      : scene_(scene_of(scene, settings, reference)), run_(scene_) {}

  void step() {
    if (run_.world.facts().over) throw Error(ExitCode::usage, "the run is over: time_s is its duration");
    run_.cycle();
    if (over()) run_.close();  // the last reports count, as at the end of a run of the programs
    if (raised) throw_raised();
    if (!run_.finite()) throw Error(ExitCode::failed, fmt::format("a force is not finite at {} s", time_s()));
  }
  void finish() {
    while (!over()) {
      step();
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    }
  }
  [[nodiscard]] double time_s() const { return run_.world.facts().time_s; }
  [[nodiscard]] bool over() const { return run_.world.facts().over; }
  [[nodiscard]] std::string state_hash() const { return fmt::format("{:016x}", run_.world.facts().state_hash); }
  [[nodiscard]] const FeltHistory& felt(std::size_t user) const {
    if (user >= run_.felt.size()) throw py::index_error(fmt::format("user {}: {} take part", user, run_.felt.size()));
    return run_.felt[user];
  }
  [[nodiscard]] std::vector<std::string> bodies() const {
    std::vector<std::string> names;
    for (const Body& body : scene_.bodies) names.push_back(body.name);
    return names;
  }
  [[nodiscard]] py::dict state(const std::string& body) const {
    for (const Body& one : scene_.bodies) {
      if (one.name != body) continue;
      const BodyState now = run_.world.engine().state(one.id);
      const Quat& q = now.orientation;
      const auto triple = [](const Vec3& v) { return py::make_tuple(v.x(), v.y(), v.z()); };
      return py::dict(
          "position_m"_a = triple(now.position), "orientation"_a = py::make_tuple(q.w(), q.x(), q.y(), q.z()),
          "velocity_m_s"_a = triple(now.linear_velocity), "angular_velocity_rad_s"_a = triple(now.angular_velocity));
    }
    throw py::key_error(body);
  }
  [[nodiscard]] double h_s() const { return scene_.settings.h_s; }

 private:
  [[noreturn]] static void throw_raised() {
    const py::object error = std::exchange(raised, {});
    PyErr_SetObject(py::type::of(error).ptr(), error.ptr());
    throw py::error_already_set();
  }
  Scene scene_;
  CoupledRun run_;
};

/// Reads the forces that leave for a device of a running simulation.
class Forces {
 public:
  Forces(int domain, int user, const std::string& dds, const std::string& secure)
      : bus_(open_bus({.vendor = parse_vendor(dds),
                       .domain = domain,
                       .mode = Mode::realtime,
                       .secure = secure,
                       .participant_name = "subworld python"})),
        commands_(*bus_, device_partition(user)) {}

  [[nodiscard]] Array take() {
    std::vector<std::array<double, 7>> taken;
    for (DeviceCommand command; commands_.take(command);) {
      if (command.last) continue;  // has no force
      const Vec3 &f = command.wrench.force, &t = command.wrench.torque;
      taken.push_back({command.stamp_s, f.x(), f.y(), f.z(), t.x(), t.y(), t.z()});
    }
    Array made({taken.size(), std::size_t{7}});
    std::copy_n(taken.empty() ? nullptr : taken.front().data(), 7 * taken.size(), made.mutable_data());
    return made;
  }

 private:
  std::unique_ptr<Bus> bus_;
  Watched<DeviceCommand> commands_;
};

}  // namespace

PYBIND11_MODULE(subworld_core, m) {
  m.doc() = "The whole system in one process, step by step: deploy/python/README.md has examples.";
  py::register_exception<Error>(m, "Error");
  py::class_<InProcess>(m, "InProcess", "A run in lock-step in this process: world, sub-worlds, emulated devices.")
      .def(py::init<std::string, Changes, bool>(), "scene"_a, "settings"_a = Changes{}, "reference"_a = false,
           "scene: a file, or the name of a scene of Subworld. settings: {KEY: VALUE}, as of --set. reference: the "
           "whole "
           "scene in one world at the haptic step, without coupling.")
      .def("step", &InProcess::step, "Makes the haptic steps of a cycle, and the world's cycle.")
      .def("finish", &InProcess::finish, "Steps until the scene's duration is over.")
      .def_property_readonly("time_s", &InProcess::time_s, "Simulated time of the world, s.")
      .def_property_readonly("over", &InProcess::over)
      .def_property_readonly("h_s", &InProcess::h_s, "The haptic step, s.")
      .def_property_readonly("state_hash", &InProcess::state_hash, "When the run is over: that of `subworld run`.")
      .def_property_readonly("bodies", &InProcess::bodies, "Names of the bodies.")
      .def("state", &InProcess::state, "body"_a,
           "State of a body in the world, in SI units; quaternions are w, x, y, z.")
      .def(
          "force_n", [](const InProcess& run, std::size_t user) { return rows(run.felt(user).force); }, "user"_a = 0,
          "Force of the coupling on the proxy, N: a row of x, y, z for each haptic step so far.")
      .def(
          "operator_force_n", [](const InProcess& run, std::size_t user) { return rows(run.felt(user).on_operator); },
          "user"_a = 0, "Force of the device on the operator, N, likewise.");
  py::class_<Forces>(m, "Forces", "Reads the forces that leave for a device of a running simulation.")
      .def(py::init<int, int, std::string, std::string>(), "domain"_a, "user"_a = 0, "dds"_a = "fastdds",
           "secure"_a = "")
      .def("take", &Forces::take,
           "Those since the last call, the newest 8 at most, a row each: simulated time in s, force x, y, z in N, "
           "torque x, "
           "y, z in N m. Waits for none.");
  m.def(
      "force_error",
      [](const Array& force, const Array& reference, double h_s) {
        const ForceError error = force_error(vectors(force), vectors(reference), h_s);
        return py::dict("rms"_a = error.rms, "p99"_a = error.p99, "max"_a = error.max,
                        "time_offset_s"_a = error.time_offset_s);
      },
      "force"_a, "reference"_a, "h_s"_a,
      "Difference of a force from its reference, as a share of the reference: rms, p99 and max; and the lag, s.");
  m.def(
      "schemes",
      [] {
        std::vector<std::string> names;
        for (const Scheme* one : schemes()) names.emplace_back(one->properties.name);
        return names;
      },
      "Names of the coupling schemes.");
  m.def(
      "add_scheme", add_python_scheme, "name"_a, "correction"_a, "base"_a = "reduced",
      "Adds a scheme, which is `base` with another correction: correction(owner, lag_cycles) returns by which parts of "
      "their difference the copies of a body are moved, in the world and in the sub-world, 0 to 1 each. lag_cycles: "
      "age of the world's state, infinite where there is none yet. owner: "
      "\"world\" for a body, \"user\" for the proxy, \"peer\" for the proxy of another user.");
}
