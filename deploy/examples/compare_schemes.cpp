// The felt-force error of each scheme, also of one that is not part of Subworld, and the time of its steps. The
// reference is a single world at the haptic step.
#include "half_way.hpp"
#include "io/options/scene_name.hpp"
#include "lab/session/coupled_run.hpp"
#include "lab/session/metrics.hpp"
#include "model/error.hpp"

#include <fmt/core.h>

using namespace subworld;

static void measure(Scene scene, const Scheme& scheme, int ratio, const FeltHistory& reference) {
  scene.settings.scheme = scheme.properties.name;
  scene.settings.set_ratio({ratio, ratio});
  CoupledRun run(scene);
  if (!run.run()) throw Error(ExitCode::failed, fmt::format("{}: a force is not finite", scheme.properties.name));
  const ForceError error = force_error(run.felt[0].force, reference.force, scene.settings.h_s);
  fmt::print("{},{},{:.2f},{:.0f},{:.0f}\n", scheme.properties.name, ratio, 100.0 * error.rms,
             1e6 * run.cpu.haptic.quantile_s(0.99), 1e6 * run.cpu.world.quantile_s(0.99));
}

int main(int argc, char** argv) try {
  if (argc != 2) throw Error(ExitCode::usage, "usage: compare_schemes SCENE");
  add_scheme(half_way::kScheme);
  Scene scene = load_scene(scene_file(argv[1]));
  keep_users(scene, 1);
  CoupledRun reference(in_one_world(scene));
  reference.run();
  fmt::print("scheme,ratio,rms_error_percent,haptic_step_p99_us,world_cycle_p99_us\n");
  for (const Scheme* scheme : schemes())
    for (const int ratio : {4, 20}) measure(scene, *scheme, ratio, reference.felt[0]);
} catch (const Error& error) {
  fmt::print(stderr, "{}\n", error.what());
  return static_cast<int>(error.code());
}
