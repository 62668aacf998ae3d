#include "model/scene.hpp"
#include "model/scene_reader.hpp"

#include <fmt/format.h>

#include <charconv>

namespace subworld {

namespace {

constexpr Limits kDuration{.least = 0.0, .most = 1e6, .above = true};  // s
constexpr Limits kDelay{.least = 0.0, .most = 1.0};                    // s
const std::initializer_list<std::string_view> kSettingsKeys = {
    "h_s",   "ratio", "duration_s", "settle",   "users", "mode",   "scheme", "gravity_m_s2",
    "paper", "delay", "passivity",  "deadband", "world", "haptic", "absent", "presence"};
const std::initializer_list<std::string_view> kPresets = {"fast", "quality"};

/// The engine's name is checked when the engine is made: this room knows no engines.
void read_engine(const YamlValue& value, EngineSettings& engine) {
  const YamlMap map(value, {"engine", "preset", "iterations", "substeps", "longest_substep_s", "length_unit_m"});
  if (const auto name = map.find("engine")) engine.name = name->name();
  if (const auto preset = map.find("preset")) engine.preset = *(kPresets.begin() + preset->choice(kPresets));
  if (const auto iterations = map.find("iterations")) engine.iterations = iterations->integer(1, 100'000);
  if (const auto substeps = map.find("substeps")) engine.substeps = substeps->integer(1, 1000);
  if (const auto longest = map.find("longest_substep_s"))
    engine.longest_substep_s = longest->number({.least = 1e-5, .most = 1.0});
  if (const auto unit = map.find("length_unit_m")) engine.length_unit_m = unit->number({.least = 1e-6, .most = 1e6});
}

/// One number, or [smallest, largest].
void read_ratio(const YamlValue& value, Settings& settings) {
  if (value.is_scalar()) {
    const int ratio = value.integer(1, kMostRatio);
    settings.set_ratio({ratio, ratio});
    return;
  }
  const std::vector<YamlValue> bounds = value.items();
  if (bounds.size() != 2) value.fail("must be a whole number, or the smallest and the largest as in [4, 12]");
  const int least = bounds[0].integer(1, kMostRatio);
  settings.set_ratio({least, bounds[1].integer(least, kMostRatio)});
}

}  // namespace

std::optional<RatioBounds> parse_ratio(std::string_view text) {
  RatioBounds ratio;
  const char* const end = text.data() + text.size();
  const auto least = std::from_chars(text.data(), end, ratio.least);
  if (least.ec != std::errc{}) return std::nullopt;
  ratio.most = ratio.least;
  if (least.ptr != end) {
    if (*least.ptr != '-') return std::nullopt;
    const auto most = std::from_chars(least.ptr + 1, end, ratio.most);
    if (most.ec != std::errc{} || most.ptr != end) return std::nullopt;
  }
  if (ratio.least < 1 || ratio.most < ratio.least || ratio.most > kMostRatio) return std::nullopt;
  return ratio;
}

std::string to_text(const RatioBounds& ratio) {
  return ratio.most > ratio.least ? fmt::format("{}-{}", ratio.least, ratio.most) : fmt::format("{}", ratio.least);
}

void read_settings(const YamlValue& value, Settings& settings) {
  const YamlMap map(value, kSettingsKeys);
  map.read("h_s", settings.h_s, {.least = 1e-6, .most = 0.1});
  if (const auto ratio = map.find("ratio")) read_ratio(*ratio, settings);
  map.read("duration_s", settings.duration_s, kDuration);
  if (const auto settle = map.find("settle")) {
    const YamlMap times(*settle, {"duration_s", "step_s"});
    times.read("duration_s", settings.settle_s, {.least = 0.0, .most = 1e6});
    times.read("step_s", settings.settle_step_s, {.least = 1e-6, .most = 0.1});
  }
  map.read("users", settings.users, 0, 64);
  if (const auto mode = map.find("mode")) settings.mode = static_cast<Mode>(mode->choice({"lockstep", "realtime"}));
  if (const auto absent = map.find("absent"))
    settings.absent = static_cast<Absent>(absent->choice({"end", "wait", "continue"}));
  if (const auto presence = map.find("presence")) {
    for (const YamlValue& item : presence->items()) {
      if (const std::string fault = parse_presence(item.text(), settings.presence); !fault.empty()) item.fail(fault);
    }
  }
  if (const auto scheme = map.find("scheme")) settings.scheme = scheme->name();  // the coupling checks it
  if (const auto paper = map.find("paper")) {
    const YamlMap own(*paper, {"device_force_in_world", "device_impulse_threshold_n_s"});
    own.read("device_force_in_world", settings.paper.device_force_in_world);
    own.read("device_impulse_threshold_n_s", settings.paper.device_impulse_threshold_n_s, kNotNegative);
  }
  if (const auto delay = map.find("delay")) {
    const YamlMap own(*delay, {"up_s", "down_s", "from_device_s", "to_device_s", "jitter_s", "loss_ratio", "seed"});
    own.read("up_s", settings.delay.up_s, kDelay);
    own.read("down_s", settings.delay.down_s, kDelay);
    own.read("from_device_s", settings.delay.from_device_s, kDelay);
    own.read("to_device_s", settings.delay.to_device_s, kDelay);
    own.read("jitter_s", settings.delay.jitter_s, kDelay);
    own.read("loss_ratio", settings.delay.loss_ratio, {.least = 0.0, .most = 0.9});
    int seed = 1;
    own.read("seed", seed, 0, 1'000'000'000);
    settings.delay.seed = static_cast<std::uint64_t>(seed);
  }
  if (const auto passivity = map.find("passivity"))
    settings.passivity = static_cast<Passivity>(passivity->choice({"automatic", "on", "off"}));
  map.read("deadband", settings.deadband, {.least = 0.0, .most = kMostDeadband});
  if (const auto world = map.find("world")) read_engine(*world, settings.world);
  if (const auto haptic = map.find("haptic")) read_engine(*haptic, settings.haptic);
  if (const auto gravity = map.find("gravity_m_s2")) {
    settings.world.gravity = gravity->vec3({.least = -1e4, .most = 1e4});
    settings.haptic.gravity = settings.world.gravity;
  }
}

Scene load_scene(const std::string& file) {
  const YamlNode root = read_yaml(file);
  const YamlMap map({file, "", root, root.mark}, {"name", "description", "settings", "materials", "bodies", "users"});
  Scene scene;
  scene.file = file;
  scene.name = map.at("name").name();
  map.read("description", scene.description);
  if (const auto settings = map.find("settings")) read_settings(*settings, scene.settings);
  Materials materials;
  if (const auto value = map.find("materials")) materials = read_materials(*value);
  BodyReader bodies(scene, std::move(materials));
  bodies.read_bodies(map.at("bodies"));
  read_users(map.at("users"), bodies, scene);
  if (scene.settings.users > static_cast<int>(scene.users.size())) {
    YamlMap(map.at("settings"), kSettingsKeys)
        .at("users")
        .fail(fmt::format("must be at most the {} users that the scene lists, not {}", scene.users.size(),
                          scene.settings.users));
  }
  return scene;
}

}  // namespace subworld
