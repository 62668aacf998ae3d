// A generator of scenes: writes a tower of cubes that a tool pushes at half its height, and reads it as each program
// does.
#include "model/error.hpp"
#include "model/scene/scene.hpp"

#include <fmt/core.h>

#include <cstdlib>
#include <fstream>

using namespace subworld;

static std::string tower(int cubes) {
  constexpr double kSide_m = 0.08, kTool_m = 0.03;
  std::string text =
      "name: tower\n"
      "settings: {duration_s: 3, settle: {duration_s: 0.5, step_s: 0.004}}\n"
      "materials: {wood: {friction: 0.5}}\n"
      "bodies:\n"
      "  - {name: floor, shape: plane, fixed: true, material: wood}\n";
  for (int i = 0; i < cubes; ++i)
    text += fmt::format(
        "  - {{name: cube_{0}, shape: box, size_m: [{1}, {1}, {1}], material: wood, density_kg_m3: 600, position_m: "
        "[0, 0, "
        "{2:.4f}]}}\n",
        i, kSide_m, (i + 0.5) * kSide_m);
  // Its middle is that of a cube, and it begins 5 cm away.
  return text + fmt::format(
                    "users:\n"
                    "  - name: visitor\n"
                    "    proxy: {{shape: sphere, radius_m: {0}, mass_kg: 0.1, position_m: [{1}, 0, {2:.4f}], "
                    "rotates: false, gravity: false}}\n"
                    "    device: {{path: [{{move: [0.08, 0, 0], during_s: [0.5, 2.5]}}]}}\n",
                    kTool_m, -(0.5 * kSide_m + kTool_m + 0.05), (cubes / 2 + 0.5) * kSide_m);
}

int main(int argc, char** argv) try {
  const int cubes = argc == 3 ? std::atoi(argv[1]) : 0;
  if (cubes < 1 || cubes > 100) throw Error(ExitCode::usage, "usage: make_tower CUBES FILE.yaml, 1 to 100 cubes");
  std::ofstream(argv[2]) << tower(cubes);
  const Scene scene = load_scene(argv[2]);  // names line and cure of a fault
  fmt::print("{}: {} bodies, {} user\n", argv[2], scene.bodies.size(), scene.users.size());
} catch (const Error& error) {
  fmt::print(stderr, "{}\n", error.what());
  return static_cast<int>(error.code());
}
