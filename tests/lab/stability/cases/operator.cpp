// The largest stiffness that a device can render, and the noise of the force at rest.

#include "lab/session/metrics.hpp"
#include "lab/session/operator_bed.hpp"
#include "lab/stability/cases/cases.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

namespace subworld {

namespace {

const char* const kSteady = "Statics: forces in equilibrium do not change";
constexpr double kBound = 1.1;  ///< for a limit that must be reached: a designer leaves more than 10 % of margin

/// Whether the motion after the push, 0.05 m/s, decays.
bool comes_to_rest(const Scene& scene, double rest_s) {
  constexpr double kRests_m_s = 1e-9, kGone_m_s = 0.2;
  CoupledRun run(scene);
  double early_m_s = 0.0, late_m_s = 0.0;
  run_while(run, rest_s, [&] {
    const double speed_m_s = run.devices[0]->state().linear_velocity.norm();
    const double t_s = run.world.facts().time_s;
    if (t_s > 0.25 * rest_s && t_s <= 0.5 * rest_s) early_m_s = std::max(early_m_s, speed_m_s);
    if (t_s > 0.75 * rest_s || speed_m_s > kGone_m_s) late_m_s = std::max(late_m_s, speed_m_s);
    return speed_m_s <= kGone_m_s;
  });
  return late_m_s < std::max(std::min(early_m_s, kGone_m_s), kRests_m_s);
}

/// A search around the expected value.
Search around_stiffness(double stiffness_n_m) {
  return {.from = 0.1 * stiffness_n_m, .to = 10.0 * stiffness_n_m, .stride = 2.0, .precision = 1.02};
}

/// The stiffest wall of this kind in which the device comes to rest; its damping B = `damped_s` K.
Measurement stiffest_wall(SampledWall wall, double expected_n_m, double damped_s = 0.0, const Sensor& sensor = {}) {
  const double rest_s = 8000.0 * (1 + wall.delay) * wall.period_s;
  return limit_at(find_limit(around_stiffness(expected_n_m), [&](double k) {
    wall.wall_damping_n_s_m = damped_s * k;
    return comes_to_rest(wall_scene(wall, k, sensor), rest_s);
  }));
}

/// K of the exact root where the wall's damping is `damped_s` K.
double damped_root(double damped_s) {
  SampledWall wall;
  double low = 0.0, high = largest_stiffness(wall) / damped_s;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    wall.wall_damping_n_s_m = damped_s * middle;
    (largest_stiffness(wall) > middle ? low : high) = middle;
  }
  return low;
}

SampledWall delayed_wall(double samples) { return {.delay = static_cast<int>(samples)}; }
SampledWall heavy_wall(double mass_kg) { return {.mass_kg = mass_kg, .damping_n_s_m = 5.0 * mass_kg}; }
SampledWall sampled_wall(double period_ms) { return {.period_s = 1e-3 * period_ms}; }

constexpr double kFriction_n = 0.1;
/// K <= min(2 b / T, 2 f / delta).
double passive_stiffness(double resolution_um) {
  const SampledWall wall;
  return std::min(2.0 * wall.damping_n_s_m / wall.period_s, 2.0 * kFriction_n / (1e-6 * resolution_um));
}

/// `press` with this engine, without the passivity bound, which would stabilise it.
Scene press_in(const EngineSetting& setting) {
  Scene scene = in_engine(scene_with_operator("press", DeviceKind::impedance), setting);
  scene.settings.passivity = Passivity::off;
  return scene;
}

/// Largest stiffness of a wall for the device with the operator who holds it.
double held_root(const Scene& scene) {
  const UserSpec& user = scene.users[0];
  UserSpec held = user;
  held.device.mass_kg += user.device.operator_model->mass_kg;
  held.device.damping_n_s_m += user.device.operator_model->damping_n_s_m;
  return largest_stiffness(held, scene.settings);
}

Scene late_press(const EngineSetting& setting, Side where, double delay_ms) {
  Scene scene = press_in(setting);
  lengthen(scene, where, 1e-3 * delay_ms, 0.0, 0.0);
  return scene;
}

/// Noise of the force on the operator in an interval of time.
double noise_between(const CoupledRun& run, double h_s, double from_s, double to_s) {
  const auto begin = static_cast<std::size_t>(std::lround(from_s / h_s));
  const auto count = static_cast<std::size_t>(std::lround((to_s - from_s) / h_s));
  return noise_n(std::span(run.felt[0].on_operator).subspan(begin, count));
}

/// The largest stiffness of the coupling with which a pressed and held cube comes to rest.
Measurement stiffest_press(Scene scene) {
  constexpr double kStill_n = 0.1;  ///< threshold of perception of a finger
  const double h_s = scene.settings.h_s;
  scene.users[0].device.path.resize(1);  // without the release
  return limit_proven(find_limit({.from = 100.0, .to = 1e5, .stride = 2.0, .precision = 1.05}, [&](double k) {
    scene.users[0].coupling.stiffness_n_m = k;
    CoupledRun run(scene);
    run_while(run, 4.0, [] { return true; });
    return noise_between(run, h_s, 3.0, 4.0) < std::max(kStill_n, 0.5 * noise_between(run, h_s, 1.0, 2.0));
  }));
}

/// Noise of the force while the top of a stack of ten is held down by 0.2 mm.
Measurement stack_noise(const EngineSetting& setting, const char* scheme) {
  constexpr double kStiffness_n_m = 1e5, kDown_m = 2e-4, kFrom_s = 1.5, kTo_s = 2.5;
  Scene scene = in_engine(scene_with_operator("tower_press", DeviceKind::impedance), setting);
  scene.settings.scheme = scheme;
  UserSpec& user = scene.users[0];
  user.device.operator_model.reset();
  user.coupling.stiffness_n_m = kStiffness_n_m;
  user.device.path = {{.from_s = 0.3, .to_s = 1.0, .displacement = Vec3(0, 0, -kDown_m)}};
  CoupledRun run(scene);
  run_while(run, kTo_s, [] { return true; });
  return {noise_between(run, scene.settings.h_s, kFrom_s, kTo_s)};
}

}  // namespace

std::vector<StabilityCase> operator_cases() {
  const char* const root =
      "b (1 - a) / (tau (1 - a) - a T), a = exp(-b T / m), tau = m / b; with delay and damping "
      "the least K with a root of z^n + K G_x(z) + B G_v(z) on the unit circle";
  const char* const gil =
      "Gil, Avello, Rubio, Florez 2004, Stability analysis of a 1 DOF haptic interface using the "
      "Routh-Hurwitz criterion, IEEE Trans. Control Systems Technology 12(4)";
  const char* const margin = "a designer leaves more than 10 % of margin";
  const auto wall_case = [&](const char* name, const char* shows, const char* parameter, const char* unit,
                             std::vector<double> values, SampledWall (*wall)(double)) {
    return StabilityCase{
        .name = name,
        .shows = shows,
        .parameter = parameter,
        .parameter_unit = unit,
        .values = std::move(values),
        .quantity = "stiffness",
        .unit = "N/m",
        .formula = root,
        .source = gil,
        .tolerance = kBound - 1.0,
        .why = margin,
        .expected = [wall](double value) { return largest_stiffness(wall(value)); },
        .measure = [wall](const EngineSetting&,
                          double value) { return stiffest_wall(wall(value), largest_stiffness(wall(value))); },
        .once = true};
  };
  const auto press_case = [&](const char* name, const char* shows, const char* parameter, std::vector<double> values,
                              Side where) {
    return StabilityCase{
        .name = name,
        .shows = shows,
        .parameter = parameter,
        .parameter_unit = "ms",
        .values = std::move(values),
        .quantity = "stiffness",
        .unit = "N/m",
        .formula = root,
        .source = gil,
        .compare = Compare::at_least,
        .tolerance = kBound,
        .why = margin,
        .expected = [where](double ms) { return held_root(late_press({}, where, where == Side::device ? ms : 0.0)); },
        .measure = [where](const EngineSetting& s, double ms) { return stiffest_press(late_press(s, where, ms)); },
        .own_step = true};
  };
  const auto stack_case = [&](const char* name, const char* scheme) {
    return StabilityCase{
        .name = name,
        .shows = "The top of a stack of ten is held down with a coupling of 100 N/mm, in haptic steps of 1 ms.",
        .quantity = "noise of the force, RMS",
        .unit = "N",
        .formula = "0: a body at rest under a constant load exerts a constant force",
        .source = kSteady,
        .compare = Compare::absolute,
        .tolerance = 0.1,
        .why = "a finger feels vibrations of 0.1 N at 100 Hz and more",
        .measure = [scheme](const EngineSetting& s, double) { return stack_noise(s, scheme); },
        .own_step = true};
  };
  return {
      wall_case(
          "wall_delay",
          "The stiffest wall in which a device of 0.1 kg and 0.5 N s/m comes to rest at 1 kHz, with delayed samples.",
          "delay", "samples", {0.0, 5.0, 1.0, 20.0}, delayed_wall),
      wall_case("wall_mass", "The same for devices of other masses, with 5 N s/m for each kg.", "mass", "kg",
                {1.0, 0.02}, heavy_wall),
      wall_case("wall_period", "The same for other sampling periods.", "period", "ms", {4.0, 0.25, 2.0}, sampled_wall),
      {.name = "wall_damped",
       .shows = "The same with a damped wall; B / K is given in ms.",
       .parameter = "B / K",
       .parameter_unit = "ms",
       .values = {1.0, 5.0, 20.0},
       .quantity = "stiffness",
       .unit = "N/m",
       .formula = root,
       .source = gil,
       .tolerance = kBound - 1.0,
       .why = margin,
       .expected = [](double ms) { return damped_root(1e-3 * ms); },
       .measure = [](const EngineSetting&, double ms) { return stiffest_wall({}, damped_root(1e-3 * ms), 1e-3 * ms); },
       .once = true},
      {.name = "wall_quantised",
       .shows = "The same for a device with a Coulomb friction of 0.1 N and an encoder of this resolution.",
       .parameter = "resolution",
       .parameter_unit = "um",
       .values = {400.0, 50.0},
       .quantity = "stiffness",
       .unit = "N/m",
       .formula = "min(2 b / T, 2 f / delta)",
       .source = "Abbott and Okamura 2005, Effects of position quantization and sampling rate on virtual-wall "
                 "passivity, IEEE Trans. Robotics 21(5); Diolaiti et al. 2006, Stability of haptic rendering",
       .compare = Compare::at_least,
       .tolerance = kBound,
       .why = margin,
       .expected = passive_stiffness,
       .measure =
           [](const EngineSetting&, double um) {
             return stiffest_wall({}, passive_stiffness(um), 0.0, {kFriction_n, 1e-6 * um});
           },
       .once = true},
      press_case(
          "press_device_delay",
          "The stiffest coupling with which a cube that the operator presses against a wall comes to rest, with this "
          "round-trip delay between device and sub-world. Expected is the limit of a rigid wall.",
          "delay at the device", {0.0, 4.0, 20.0}, Side::device),
      press_case("press_world_delay",
                 "The same with the delay between sub-world and world, which does not delay the sub-world's bodies.",
                 "delay to the world", {100.0, 20.0}, Side::world),
      stack_case("stack_reduced", "reduced"),
      stack_case("stack_direct", "direct"),
  };
}

}  // namespace subworld
