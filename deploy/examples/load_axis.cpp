// An axis of a lab that no setting has: the mass of all bodies, times a factor. One row for each factor: how much force
// the load needs, and the error and time of the coupling.
#include "io/options/scene_name.hpp"
#include "lab/session/coupled_run.hpp"
#include "lab/session/metrics.hpp"
#include "model/error.hpp"

#include <fmt/core.h>

#include <cstdlib>

using namespace subworld;

static Scene loaded(Scene scene, double factor) {
  for (Body& body : scene.bodies) {
    if (body.fixed() || body.id == scene.users[0].proxy) continue;
    body.mass *= factor;
    body.inertia *= factor;
  }
  return scene;
}

static void measure(const Scene& scene, double factor) {
  CoupledRun reference(in_one_world(scene)), run(scene);
  if (!reference.run() || !run.run())
    throw Error(ExitCode::failed, fmt::format("load {}: a force is not finite", factor));
  double square_n2 = 0.0;
  for (const Vec3& force : reference.felt[0].force) square_n2 += force.squaredNorm();
  const double rms_n = std::sqrt(square_n2 / static_cast<double>(reference.felt[0].force.size()));
  const ForceError error = force_error(run.felt[0].force, reference.felt[0].force, scene.settings.h_s);
  fmt::print("{},{:.3f},{:.2f},{:.0f}\n", factor, rms_n, 100.0 * error.rms, 1e6 * run.cpu.haptic.quantile_s(0.99));
}

int main(int argc, char** argv) try {
  if (argc < 3) throw Error(ExitCode::usage, "usage: load_axis SCENE FACTOR...");
  Scene scene = load_scene(scene_file(argv[1]));
  keep_users(scene, 1);
  fmt::print("load,force_rms_n,rms_error_percent,haptic_step_p99_us\n");
  for (int i = 2; i < argc; ++i) {
    const double factor = std::atof(argv[i]);
    if (!(factor > 0.0)) throw Error(ExitCode::usage, fmt::format("factor {}: must be larger than 0", argv[i]));
    measure(loaded(scene, factor), factor);
  }
} catch (const Error& error) {
  fmt::print(stderr, "{}\n", error.what());
  return static_cast<int>(error.code());
}
