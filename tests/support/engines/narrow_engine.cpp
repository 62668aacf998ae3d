// Bullet with every limit that an engine can declare, at low values.
#include "physics/plugin.hpp"

namespace {

std::unique_ptr<subworld::Engine> make_narrow(const subworld::EngineSettings& settings,
                                              std::span<const subworld::Mesh> meshes) {
  subworld::EngineSettings bullet = settings;
  bullet.name = "bullet";
  return subworld::make_engine(bullet, meshes);
}

constexpr subworld::EnginePreset kPresets[] = {
    {.name = "fast", .what = "as of bullet", .heavy_on_light = {.at_1_ms = 40.0, .at_4_ms = 10.0}}};

const subworld::EnginePlugin kPlugin{.name = "narrow",
                                     .version = "of the tests",
                                     .licence = "Apache-2.0",
                                     .presets = kPresets,
                                     .limits = {.smallest_box = 0.03,
                                                .plane_half_side_m = 5.0,
                                                .speed_m_s = 50.0,
                                                .spin_rad_s = 100.0,
                                                .iterations = 20},
                                     .make = make_narrow};

}  // namespace

SUBWORLD_ENGINE_PLUGIN(kPlugin)
