// Bullet, but slow to make, like an engine that compiles or reads large files.
#include "physics/plugin.hpp"

#include <chrono>
#include <thread>

namespace {

std::unique_ptr<subworld::Engine> make_slowly(const subworld::EngineSettings& settings,
                                              std::span<const subworld::Mesh> meshes) {
  std::this_thread::sleep_for(std::chrono::seconds(3));
  subworld::EngineSettings bullet = settings;
  bullet.name = "bullet";
  return subworld::make_engine(bullet, meshes);
}

constexpr subworld::EnginePreset kPresets[] = {{.name = "fast", .what = "as of bullet"}};

const subworld::EnginePlugin kPlugin{
    .name = "slow", .version = "of the tests", .licence = "Apache-2.0", .presets = kPresets, .make = make_slowly};

}  // namespace

SUBWORLD_ENGINE_PLUGIN(kPlugin)
