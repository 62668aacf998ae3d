#include "model/joined.hpp"
#include "model/settings/settings.hpp"

#include "model/error.hpp"
#include "model/scene/scene_reader.hpp"

#include <fmt/core.h>

#include <sstream>
#include <type_traits>
#include <utility>

namespace subworld {

namespace {

constexpr Limits kSeconds{.least = 0.0, .most = 1e6};  // s
constexpr Limits kStep{.least = 1e-6, .most = 0.1};
constexpr Limits kDelay{.least = 0.0, .most = 1.0};
constexpr Limits kRoundTrip{.least = 0.0, .most = 2.0};
constexpr Limits kMoreSeconds{.least = 0.0, .most = 1e6, .above = true};  // s, m
constexpr Limits kSubStep{.least = 1e-5, .most = 1.0};
constexpr Limits kMetres{.least = 1e-6, .most = 1e6};
constexpr Limits kLarge{.least = 0.0, .most = 1e9};
constexpr Limits kLargePositive{.least = 0.0, .most = 1e9, .above = true};

// The readers of settings.
constexpr const char* kEveryone = "all";
constexpr const char* kOfWorld = "world_sim";
constexpr const char* kCoupled = "world_sim, haptic_sim";
constexpr const char* kHaptic = "haptic_sim";
constexpr const char* kDevice = "device_sim";
constexpr const char* kUserSide = "haptic_sim, device_sim";
constexpr const char* kOfPreset = "the preset's";

template <class T>
SettingMember at(T& member) {
  if constexpr (std::is_enum_v<T>) {
    return reinterpret_cast<unsigned char*>(&member);
  } else {
    return &member;
  }
}
#define RUN(member) [](Settings& s, UserSpec&) { return at(s.member); }
#define USER(member) [](Settings&, UserSpec& u) { return at(u.member); }
#define ARM(member)                                                                                                   \
  [](Settings&, UserSpec& u) {                                                                                        \
    return SettingMember(u.device.operator_model ? &u.device.operator_model->member : static_cast<double*>(nullptr)); \
  }

/// The words of a list, or of a text with commas between them.
std::vector<std::string> words_of(const YamlValue& value) {
  std::vector<std::string> words;
  if (value.is_scalar()) {
    std::istringstream text(value.text());
    for (std::string word; std::getline(text >> std::ws, word, ',');) words.push_back(word);
  } else {
    for (const YamlValue& item : value.items()) words.push_back(item.text());
  }
  return words;
}

/// One number, or [smallest, largest], or both as in 4-12.
void read_ratio(const YamlValue& value, Settings& settings, UserSpec& /*user*/) {
  if (!value.is_scalar()) {
    const std::vector<YamlValue> bounds = value.items();
    if (bounds.size() != 2) value.fail("must be a whole number, or the smallest and the largest as in [4, 12]");
    const int least = bounds[0].integer(1, kMostRatio);
    return settings.set_ratio({least, bounds[1].integer(least, kMostRatio)});
  }
  const std::string text = value.text();
  const std::size_t dash = text.find('-', 1);
  if (const auto bounds = parse_ratio(text)) return settings.set_ratio(*bounds);
  if (const auto turned =
          dash == std::string::npos ? std::nullopt : parse_ratio(text.substr(dash + 1) + "-" + text.substr(0, dash)))
    value.fail(fmt::format("the smaller ratio comes first; did you mean {}?", to_text(*turned)));
  const int ratio = value.integer(1, kMostRatio);
  settings.set_ratio({ratio, ratio});
}

void read_presence(const YamlValue& value, Settings& settings, UserSpec& /*user*/) {
  settings.presence.clear();
  for (const YamlValue& item : value.is_scalar() ? std::vector{value} : value.items()) {
    if (const std::string fault = parse_presence(item.text(), settings.presence); !fault.empty()) item.fail(fault);
  }
}

void read_disabled(const YamlValue& value, Settings& settings, UserSpec& /*user*/) {
  try {
    settings.disable(parse_disabled(words_of(value), ""));
  } catch (const Error& wrong) {
    value.fail(wrong.what());
  }
}

/// Half each way.
template <double DelaySettings::*there, double DelaySettings::*back>
void read_round_trip(const YamlValue& value, Settings& settings, UserSpec& /*user*/) {
  settings.delay.*there = settings.delay.*back = 0.5 * value.number(kRoundTrip);
}

void read_gravity(const YamlValue& value, Settings& settings, UserSpec& /*user*/) {
  settings.world.gravity = settings.haptic.gravity = value.vec3({.least = -1e4, .most = 1e4});
}

void read_freedom(const YamlValue& value, Settings& /*settings*/, UserSpec& user) {
  const int freedom = value.integer(1, 6);
  if (freedom != 3 && freedom != 6) value.fail(fmt::format("must be 3 (translations) or 6, not {}", freedom));
  user.device.degrees_of_freedom = freedom;
}

/// The engine's name is checked when the engine is made: this room knows no engines. A preset that not all engines have
/// is meant for the engine that was named with it, and for its other precision; a longest sub-step for engine and
/// preset.
template <EngineSettings Settings::*engine>
void read_engine(const YamlValue& value, Settings& settings, UserSpec& /*user*/) {
  EngineSettings& now = settings.*engine;
  const std::string before = std::exchange(now.name, value.name());
  const bool related = before.starts_with(now.name) || now.name.starts_with(before);
  if (!related && now.preset != "quality") now.preset = EngineSettings{}.preset;
  now.longest_substep_s.reset();
}

/// A preset of another name is one of a plug-in, which a scene that others shall run does not name.
template <EngineSettings Settings::*engine>
void read_preset(const YamlValue& value, Settings& settings, UserSpec& /*user*/) {
  if (!value.file().empty()) (void)value.choice({"fast", "quality", "large"});
  (settings.*engine).preset = value.name();
  (settings.*engine).longest_substep_s.reset();
}

std::string text_of_ratio(const Settings& s) { return to_text(s.ratio_bounds()); }
std::string text_of_presence(const Settings& s) { return to_text(s.presence); }
std::string text_of_disabled(const Settings& s) {
  return fmt::format("[{}]", joined(disabled_names(s.disabled), ", "));
}

using Words = Setting::Range;
using S = Settings;
using Delay = DelaySettings;

// Key, member, range, meaning, readers, short form, default in words, own reader, own text.
const std::vector<Setting> kSettings{
    {"h_s", RUN(h_s), kStep, "haptic step h", kEveryone},
    {"ratio", nullptr, Limits{1, kMostRatio},
     "simulation ratio r = T / h, with the world's cycle T. Two bounds as in 4-12: it adapts between them to what the "
     "operator feels and the world costs",
     kEveryone, "--ratio", "", read_ratio, text_of_ratio},
    {"duration_s", RUN(duration_s), kMoreSeconds, "simulated time of a run", kEveryone, "--duration"},
    {"settle.duration_s", RUN(settle_s), kSeconds,
     "the world alone is simulated for this time before t = 0; bodies with a velocity are held until then", kOfWorld},
    {"settle.step_s", RUN(settle_step_s), kStep, "step of that simulation", kOfWorld},
    {"users", RUN(users), Limits{1, kMostUsers}, "number of the listed users that take part, the first ones", kEveryone,
     "--users", "all"},
    {"mode", RUN(mode), Words{"lockstep", "realtime"},
     "lockstep: the processes advance together, independent of wall time; realtime: absolute deadlines", kEveryone,
     "--mode"},
    {"absent", RUN(absent), Words{"end", "wait", "continue"},
     "lock-step: what the run does when the programs of a user fall silent; in real time it always continues", kOfWorld,
     "--absent"},
    {"presence", nullptr, kAny,
     "lock-step: when users take part and which orders the run gets, as in 1 joins 3, 2 leaves 5", kCoupled, "",
     "all users from start to end", read_presence, text_of_presence},
    {"scheme", RUN(scheme), kAny, "coupling scheme: reduced, paper or direct", kEveryone, "--scheme"},
    {"passivity", RUN(passivity), Words{"automatic", "on", "off"},
     "bounds the energy that a device gives to its operator; automatic: where messages are delayed, in real time with "
     "--peers",
     kDevice, "--passivity"},
    {"deadband", RUN(deadband), Limits{0, kMostDeadband},
     "Weber fraction of the link of a device: samples are not sent that an operator cannot tell from their "
     "extrapolation. In real time with --peers only",
     kUserSide},
    {"gravity_m_s2", RUN(world.gravity), Limits{-1e4, 1e4}, "acceleration of all bodies that have weight", kCoupled, "",
     "", read_gravity},
    {"disable", nullptr, kAny,
     "optimisations to disable, for comparison: names that `subworld plan` lists, separated by commas, or all",
     kEveryone, "--disable", "none", read_disabled, text_of_disabled},
    {"paper.device_force_in_world", RUN(paper.device_force_in_world), kAny,
     "scheme paper: the mean device force also acts on the world's proxy", kCoupled},
    {"paper.device_impulse_threshold_n_s", RUN(paper.device_impulse_threshold_n_s), kNotNegative,
     "scheme paper: below it, the user added no energy in a cycle", kCoupled},

    // Artificial delay.
    {"delay.latency_s", nullptr, kRoundTrip, "delay added to the round trip between world and sub-world, half each way",
     kCoupled, "--latency", "", read_round_trip<&Delay::up_s, &Delay::down_s>},
    {"delay.device_latency_s", nullptr, kRoundTrip,
     "delay added to the round trip between device and sub-world, half each way", kUserSide, "", "",
     read_round_trip<&Delay::from_device_s, &Delay::to_device_s>},
    {"delay.up_s", RUN(delay.up_s), kDelay, "delay from sub-world to world", kOfWorld},
    {"delay.down_s", RUN(delay.down_s), kDelay, "delay from world to sub-world", kHaptic},
    {"delay.from_device_s", RUN(delay.from_device_s), kDelay, "delay from device to sub-world", kHaptic},
    {"delay.to_device_s", RUN(delay.to_device_s), kDelay, "delay from sub-world to device", kDevice},
    {"delay.jitter_s", RUN(delay.jitter_s), kDelay, "longest extra delay of a single message, uniformly distributed",
     kEveryone},
    {"delay.loss_ratio", RUN(delay.loss_ratio), Limits{0, 0.9}, "part of the messages that is lost", kEveryone},
    {"delay.seed", RUN(delay.seed), kLarge, "seed of jitter and loss", kEveryone},

    {"world.engine", RUN(world.name), kAny, "physics engine of the world", kOfWorld, "--engine", "",
     read_engine<&S::world>},
    {"world.preset", RUN(world.preset), kAny, "settings that the engine brings: fast, quality, or large (Bullet)",
     kOfWorld, "", "", read_preset<&S::world>},
    {"world.iterations", RUN(world.iterations), Limits{1, 1e5}, "solver iterations", kOfWorld, "", kOfPreset},
    {"world.substeps", RUN(world.substeps), Limits{1, 1000},
     "sub-steps of a cycle, each with its own force on the proxies", kOfWorld, "", "the scheme's"},
    {"world.longest_substep_s", RUN(world.longest_substep_s), kSubStep,
     "the engine divides its steps until none is longer", kOfWorld, "", kOfPreset},
    {"world.length_unit_m", RUN(world.length_unit_m), kMetres, "unit of length in which the engine computes", kOfWorld},
    {"world.threads", RUN(world.threads), Limits{1, 256}, "threads that share a step, in Bullet's preset large",
     kOfWorld, "--world-threads", "1, or the cores of the world"},
    {"haptic.engine", RUN(haptic.name), kAny, "physics engine of the sub-worlds", kHaptic, "--haptic-engine", "",
     read_engine<&S::haptic>},
    {"haptic.preset", RUN(haptic.preset), kAny, "settings that the engine brings: fast, quality, or large (Bullet)",
     kHaptic, "", "", read_preset<&S::haptic>},
    {"haptic.iterations", RUN(haptic.iterations), Limits{1, 1e5}, "solver iterations", kHaptic, "", kOfPreset},
    {"haptic.substeps", RUN(haptic.substeps), Limits{1, 1000}, "engine steps in a haptic step", kHaptic, "", kOfPreset},
    {"haptic.longest_substep_s", RUN(haptic.longest_substep_s), kSubStep,
     "the engine divides its steps until none is longer", kHaptic, "", kOfPreset},
    {"haptic.length_unit_m", RUN(haptic.length_unit_m), kMetres, "unit of length in which the engine computes",
     kHaptic},

    {"users.selection", USER(selection), Words{"box", "contacts", "budget"}, "which bodies belong to the sub-world",
     kHaptic},
    {"users.box_half_m", USER(box_half_m), kMoreSeconds, "half side of the selection box around the proxy", kHaptic},
    {"users.contact_depth", USER(contact_depth), Limits{0, 1000},
     "bodies that at most this many contacts connect to the proxy also belong; required by selection contacts",
     kHaptic},
    {"users.budget_ratio", USER(budget_ratio), kMoreSeconds,
     "selection budget: part of the haptic step that the step of the sub-world may take", kHaptic},
    {"users.coupling.stiffness_n_m", USER(coupling.stiffness_n_m), kLargePositive, "stiffness of the virtual coupling",
     kUserSide},
    {"users.coupling.damping_n_s_m", USER(coupling.damping_n_s_m), kLarge, "its damping", kUserSide},
    {"users.coupling.rotational_stiffness_n_m_rad", USER(coupling.rotational_stiffness_n_m), kLarge,
     "its rotational stiffness, with 6 degrees of freedom", kUserSide},
    {"users.coupling.rotational_damping_n_m_s_rad", USER(coupling.rotational_damping_n_m_s), kLarge,
     "its rotational damping, with 6 degrees of freedom", kUserSide},
    {"users.coupling.ramp_s", USER(coupling.ramp_s), kSeconds, "the force rises from zero over this time", kUserSide},

    {"users.device.kind", USER(device.kind), Words{"impedance", "admittance"},
     "whether the device renders a force or a motion", kUserSide},
    {"users.device.degrees_of_freedom", USER(device.degrees_of_freedom), Limits{3, 6}, "3: translations only, or 6",
     kUserSide, "", "", read_freedom},
    {"users.device.rate_hz", USER(device.rate_hz), Limits{1, 1e5}, "rate of the device's own loop; usually 1 / h",
     kUserSide},
    {"users.device.force_limit_n", USER(device.force_limit_n), kLargePositive, "largest force", kUserSide},
    {"users.device.torque_limit_n_m", USER(device.torque_limit_n_m), kLargePositive,
     "largest torque, with 6 degrees of freedom", kUserSide},
    {"users.device.force_rate_limit_n_s", USER(device.force_rate_limit_n_s), kLargePositive,
     "largest rate of the force", kUserSide, "", "force_limit_n / 4 ms"},
    {"users.device.power_limit_w", USER(device.power_limit_w), kLargePositive,
     "largest power given to an operator that moves with the force", kUserSide, "", "force_limit_n times 1 m/s"},
    {"users.device.speed_limit_m_s", USER(device.speed_limit_m_s), Limits{.least = 0, .most = 0.5, .above = true},
     "largest speed of an admittance device", kUserSide},
    {"users.device.mass_kg", USER(device.mass_kg), kLargePositive, "mass of the emulated device", kDevice},
    {"users.device.damping_n_s_m", USER(device.damping_n_s_m), kLarge, "its damping", kDevice},
    {"users.device.friction_n", USER(device.friction_n), kLarge, "its Coulomb friction", kDevice},
    {"users.device.profile", USER(device.profile), Words{"constant", "minimum_jerk"},
     "speed along the path's moves and turns: constant, or that of an arm", kDevice},
    {"users.device.position_resolution_m", USER(device.position_resolution_m), kUnit,
     "resolution of its encoders; 0: exact", kDevice},

    {"users.device.operator.mass_kg", ARM(mass_kg), kLargePositive, "mass of the operator's arm", kDevice},
    {"users.device.operator.damping_n_s_m", ARM(damping_n_s_m), kLarge, "damper towards the path", kDevice},
    {"users.device.operator.stiffness_n_m", ARM(stiffness_n_m), kLarge, "spring towards the path", kDevice},
    {"users.device.operator.inertia_kg_m2", ARM(inertia_kg_m2), kLargePositive,
     "inertia of the arm, with 6 degrees of freedom", kDevice},
    {"users.device.operator.rotational_damping_n_m_s_rad", ARM(rotational_damping_n_m_s), kLarge, "rotational damper",
     kDevice},
    {"users.device.operator.rotational_stiffness_n_m_rad", ARM(rotational_stiffness_n_m), kLarge, "rotational spring",
     kDevice},
    {"users.device.operator.tremor.frequency_hz", ARM(tremor.frequency_hz), Limits{8, 12},
     "frequency of the operator's tremor", kDevice},
    {"users.device.operator.tremor.amplitude_m", ARM(tremor.amplitude_m), Limits{0, 0.01},
     "its amplitude, of the free arm; about 0.0001 is usual", kDevice}};

}  // namespace

std::span<const Setting> settings_table() { return kSettings; }

}  // namespace subworld
