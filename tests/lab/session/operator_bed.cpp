#include "lab/session/operator_bed.hpp"

#include "io/options/scene_name.hpp"
#include "rt/stop.hpp"

#include <stdexcept>

namespace subworld {

Scene scene_with_operator(const std::string& name, DeviceKind kind) {
  Scene scene = load_scene(scene_file(name));
  keep_users(scene, 1);
  scene.users[0].device.kind = kind;
  scene.users[0].device.operator_model = OperatorSpec{};
  return scene;
}

Scene free_scene(DeviceKind kind) {
  constexpr double kAbove_m = 2.0;
  Scene scene = scene_with_operator("press", kind);
  scene.initial[index(scene.users[0].proxy)].position.z() += kAbove_m;
  return scene;
}

void lengthen(Scene& scene, Side side, double delay_s, double jitter_s, double loss_ratio) {
  DelaySettings& delay = scene.settings.delay;
  (side == Side::device ? delay.from_device_s : delay.up_s) = 0.5 * delay_s;
  (side == Side::device ? delay.to_device_s : delay.down_s) = 0.5 * delay_s;
  delay.jitter_s = jitter_s;
  delay.loss_ratio = loss_ratio;
}

Scene wall_scene(const SampledWall& wall, double stiffness_n_m, const Sensor& sensor) {
  constexpr double kImmovable_kg = 1e9, kSoft_n_m = 1e-6, kAnyForce_n = 1e9, kJerk_m = 0.02, kJerkAt_s = 0.2;
  Scene scene = free_scene(DeviceKind::impedance);
  Settings& s = scene.settings;
  s.h_s = wall.period_s;
  s.set_ratio({1, 1});
  s.settle_s = 0.0;
  s.passivity = Passivity::off;
  s.delay.from_device_s = wall.delay * wall.period_s;
  UserSpec& user = scene.users[0];
  Body& proxy = scene.bodies[index(user.proxy)];
  proxy.mass = kImmovable_kg;
  user.coupling.stiffness_n_m = stiffness_n_m;
  user.coupling.damping_n_s_m = wall.wall_damping_n_s_m;
  DeviceSpec& device = user.device;
  device.rate_hz = 1.0 / wall.period_s;
  device.friction_n = sensor.friction_n;
  device.position_resolution_m = sensor.resolution_m;
  device.force_limit_n = kAnyForce_n;
  device.mass_kg = 0.5 * wall.mass_kg;
  device.damping_n_s_m = 0.5 * wall.damping_n_s_m;
  device.operator_model =
      OperatorSpec{.mass_kg = device.mass_kg, .damping_n_s_m = device.damping_n_s_m, .stiffness_n_m = kSoft_n_m};
  device.path = {{.from_s = kJerkAt_s, .to_s = kJerkAt_s + wall.period_s, .displacement = Vec3(kJerk_m, 0, 0)}};
  return scene;
}

Scene in_engine(Scene scene, const EngineSetting& setting) {
  if (setting.engine.empty()) return scene;
  for (EngineSettings* engine : {&scene.settings.world, &scene.settings.haptic}) {
    engine->name = setting.engine;
    engine->preset = setting.preset;
    engine->iterations.reset();
  }
  return scene;
}

void run_while(CoupledRun& run, double until_s, const std::function<bool()>& goes_on) {
  while (run.world.facts().time_s < until_s - 1e-9) {
    if (stop_signal() != 0) throw Interrupted{};
    run.cycle();
    if (!run.finite()) throw std::runtime_error("the state of a body is not finite");
    if (!goes_on()) return;
  }
}

}  // namespace subworld
