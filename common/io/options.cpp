#include "io/options.hpp"

#include "io/command_line.hpp"
#include "io/results.hpp"
#include "io/scene_name.hpp"
#include "model/error.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace subworld {

namespace {

struct About {
  const char* name;
  const char* what;
  const char* examples;
};

const About& about(Program program) {
  static const About kAbout[] = {
      {"world_sim", "Simulates the whole world at the coarse step T = r h and serves every user's sub-world.",
       "Examples:\n"
       "  world_sim deploy/scenes/heap.yaml --mode lockstep --duration 5\n"
       "  world_sim deploy/scenes/heap.yaml --mode realtime --domain 7 --dds cyclonedds --peers 10.0.0.2\n"},
      {"haptic_sim", "Simulates one user's haptic sub-world at the haptic rate and couples it to the device.",
       "Examples:\n"
       "  haptic_sim deploy/scenes/heap.yaml --user 0\n"
       "  haptic_sim deploy/scenes/heap.yaml --user 1 --users 2 --domain 7 --peers 10.0.0.1\n"},
      {"device_sim", "Emulates one user's haptic device and the hand that holds it.",
       "Examples:\n"
       "  device_sim deploy/scenes/heap.yaml --user 0\n"},
      {"gui_headless", "Watches a run without a window and writes a picture of it.",
       "Examples:\n"
       "  gui_headless deploy/scenes/heap.yaml --out out/heap\n"}};
  return kAbout[static_cast<std::size_t>(program)];
}

template <class T>
void override_with(T& setting, const std::optional<T>& option) {
  if (option) setting = *option;
}

/// CLI::Range compares, and so lets "nan" pass.
std::string not_finite(const std::string& text) {
  return std::isfinite(std::strtod(text.c_str(), nullptr)) ? "" : fmt::format("{} is not a finite number", text);
}

/// Two ratios in either order, as in 4-12 or 12-4.
std::optional<RatioBounds> parse_two_ratios(const std::string& text) {
  const std::size_t dash = text.find('-');
  if (dash == std::string::npos) return std::nullopt;
  const auto bounds = parse_ratio(text);
  return bounds ? bounds : parse_ratio(text.substr(dash + 1) + "-" + text.substr(0, dash));
}

}  // namespace

std::string ratio_fault(const std::string& text) {
  if (parse_ratio(text)) return {};
  if (const auto turned = parse_two_ratios(text))
    return fmt::format("{}: the smaller ratio comes first: {}", text, to_text(*turned));
  return fmt::format("{} is neither a whole number from 1 to {} nor two as in 4-12", text, kMostRatio);
}

std::string fixed_ratio_fault(const std::string& text) {
  if (const auto two = parse_two_ratios(text))
    return fmt::format("{} is not one ratio; one that adapts is --ratio {} --ratio-most {}", text, two->least,
                       two->most);
  return parse_ratio(text) ? "" : fmt::format("{} is not a whole number from 1 to {}", text, kMostRatio);
}

void add_run_options(CLI::App& app, Options& o) {
  app.option_defaults()->take_last();  // a script's defaults come first, what its caller adds wins
  app.add_option("scene", o.scene, "scene file (YAML), or the name of a scene in deploy/scenes")->required();
  app.add_option("--mode", o.mode, "lockstep: nobody looks at a clock; realtime: nobody waits")
      ->check(CLI::IsMember({"lockstep", "realtime"}));
  app.add_option("--users", o.users, "how many of the scene's users take part")->check(CLI::Range(1, 64));
  app.add_option("--scheme", o.scheme,
                 "coupling scheme: reduced, paper or direct (default: the scene's, else reduced)");
  app.add_option("--engine", o.engine, "the world's engine");
  app.add_option("--haptic-engine", o.haptic_engine, "the sub-worlds' engine");
  app.add_option("--preset", o.preset, "the world engine's preset: fast or quality");
  app.add_option("--haptic-preset", o.haptic_preset, "the sub-world engines' preset");
  app.add_option(
         "--ratio", o.ratio,
         "simulation ratio r = T / h; as 4-12 it adapts between these to what is felt and to what the world costs")
      ->check(ratio_fault);
  app.add_option("--budget", o.budget_ratio,
                 "part of the haptic step that simulating a sub-world may take: of the bodies in its box, those that "
                 "matter most and fit (default: the scene's, or 0.4)")
      ->check(CLI::Range(1e-3, 1e3))
      ->check(not_finite);
  app.add_option("--latency", o.latency_s, "lock-step: artificial delay, added to the round trip, s")
      ->check(CLI::Range(0.0, 2.0))
      ->check(not_finite);
  app.add_option("--jitter", o.jitter_s, "lock-step: most that a single message takes longer, s")
      ->check(CLI::Range(0.0, 1.0))
      ->check(not_finite);
  app.add_option("--device-latency", o.device_latency_s,
                 "lock-step: artificial delay between device and sub-world, added to the round trip, s")
      ->check(CLI::Range(0.0, 2.0))
      ->check(not_finite);
  app.add_option("--loss", o.loss_ratio,
                 "lock-step: part of the messages that is lost; between world and sub-world they come again, later")
      ->check(CLI::Range(0.0, 0.9))
      ->check(not_finite);
  app.add_option("--passivity", o.passivity,
                 "whether a device gives its hand only energy that the hand has put in: automatic (where messages are "
                 "delayed), on or off")
      ->check(CLI::IsMember({"automatic", "on", "off"}));
  app.add_option("--disable", o.disabled,
                 "items that `subworld plan` leaves out and that are kept in, for comparison: names, separated by "
                 "commas, or all")
      ->delimiter(',')
      ->take_all();
  app.add_option("--duration", o.duration_s, "simulated time, s")->check(CLI::Range(0.001, 1e6))->check(not_finite);
  app.add_option("--peers", o.network.peers, "hosts of the other programs, for networks without multicast")
      ->delimiter(',')
      ->take_all();
  app.add_option("--interface", o.network.interface_address,
                 "network interface, by name or address (default: loopback)");
  app.add_option("--qos", o.network.qos_file, "the DDS vendor's settings file");
  app.add_option("--out", o.out, "folder for results");
  app.add_option("--wait", o.wait_s, "how long to wait for the other programs, s")
      ->check(CLI::Range(0.1, 3600.0))
      ->check(not_finite);
}

void add_trace_option(CLI::App& app, Options& o) {
  app.add_option("--trace", o.trace,
                 "file for a trace of the loops, stage by stage, as Chrome trace events (Perfetto, chrome://tracing,\n"
                 "speedscope): about 3 MB a second for each user at 1 kHz");
}

void add_bodies_options(CLI::App& app, Options& o) {
  CLI::Option* bodies =
      app.add_option("--bodies", o.bodies,
                     "bodies whose states over time go to DIR/bodies.csv: names of the scene, separated by commas,\n"
                     "patterns such as 'cube*', or all that can move");
  app.add_option("--bodies-rate", o.bodies_rate_hz,
                 "how often a simulated second, Hz, at most once a cycle of the world (default: each cycle, or less\n"
                 "often so that no more than 10,000 rows a second come together)")
      ->check(CLI::Range(1e-3, 1e6))
      ->check(not_finite)
      ->needs(bodies);
}

/// Knobs whose use depends on the machine (bench_wake_up measures it): of single programs, so also by the environment.
void add_tuning(CLI::App& app, const char* program, Options& o) {
  const auto variable = [&](const char* what) {
    std::string name = fmt::format("SUBWORLD_{}_{}", program, what);
    std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::toupper(c); });
    return name;
  };
  constexpr const char* kNotInHelp = "";
  app.add_option("--core", o.cores)
      ->delimiter(',')
      ->check(CLI::Range(0, 1023))
      ->envname(variable("core"))
      ->group(kNotInHelp);
  app.add_option("--spin", o.spin_s)->check(CLI::Range(0.0, 0.01))->envname(variable("spin_s"))->group(kNotInHelp);
}

Parsed parse_options(Program program, int argc, const char* const* argv) {
  const About& me = about(program);
  Parsed parsed;
  Options& o = parsed.options;
  CLI::App app{me.what, me.name};
  app.footer(me.examples);
  add_run_options(app, o);
  app.add_option("--dds", o.network.dds, "DDS vendor")
      ->check(CLI::IsMember({"fastdds", "cyclonedds"}))
      ->envname("SUBWORLD_DDS");
  app.add_option("--domain", o.network.domain, "DDS domain id")->check(CLI::Range(0, 232))->envname("SUBWORLD_DOMAIN");
  if (program == Program::haptic_sim || program == Program::device_sim) {
    app.add_option("--user", o.user, "which of the scene's users, from 0")->check(CLI::Range(0, 63));
  }
  if (program != Program::gui_headless) add_trace_option(app, o);
  add_tuning(app, me.name, o);
  if (program == Program::world_sim) add_bodies_options(app, o);
  if (program == Program::world_sim)
    app.add_flag("--await-display", o.await_display, "start only when a display looks, so that it misses nothing");
  if (program == Program::gui_headless) {
    app.add_option("--picture-every", o.picture_every_s, "also a picture each so many simulated seconds")
        ->check(CLI::NonNegativeNumber)
        ->check(not_finite);
  }
  parsed.exit_code = parse_arguments(app, argc, argv);
  return parsed;
}

Scene load_scene(const Options& o) {
  Scene scene = load_scene(scene_file(o.scene));
  Settings& s = scene.settings;
  if (o.mode) s.mode = *o.mode == "realtime" ? Mode::realtime : Mode::lockstep;
  override_with(s.scheme, o.scheme);
  // A scene's longest sub-step is meant for the engine and preset that it names.
  if (o.engine || o.preset) s.world.longest_substep_s.reset();
  if (o.haptic_engine || o.haptic_preset) s.haptic.longest_substep_s.reset();
  override_with(s.world.name, o.engine);
  override_with(s.haptic.name, o.haptic_engine);
  override_with(s.world.preset, o.preset);
  override_with(s.haptic.preset, o.haptic_preset);
  if (o.ratio) s.set_ratio(*parse_ratio(*o.ratio));
  override_with(s.users, o.users);
  override_with(s.delay.jitter_s, o.jitter_s);
  if (o.latency_s) s.delay.up_s = s.delay.down_s = 0.5 * *o.latency_s;
  if (o.device_latency_s) s.delay.from_device_s = s.delay.to_device_s = 0.5 * *o.device_latency_s;
  override_with(s.delay.loss_ratio, o.loss_ratio);
  if (o.passivity) {
    s.passivity = *o.passivity == "on" ? Passivity::on : *o.passivity == "off" ? Passivity::off : Passivity::automatic;
  }
  s.disable(parse_disabled(o.disabled));
  if (s.mode == Mode::realtime && s.delay.any()) {
    throw Error(ExitCode::usage,
                fmt::format("{}: artificial delay and loss are for lock-step; remove settings.delay, --latency, "
                            "--device-latency, --jitter and --loss, or run with --mode lockstep",
                            o.scene));
  }
  override_with(s.duration_s, o.duration_s);
  const int declared = static_cast<int>(scene.users.size());
  if (s.users == 0) s.users = declared;
  if (s.users > declared) {
    throw Error(ExitCode::usage,
                fmt::format("--users {}: {} declares {} user{}; declare more under `users`, or ask for fewer", s.users,
                            o.scene, declared, declared == 1 ? "" : "s"));
  }
  keep_users(scene, s.users);
  if (o.budget_ratio) {
    for (UserSpec& user : scene.users) {
      user.selection = Selection::budget;
      user.budget_ratio = *o.budget_ratio;
    }
  }
  if (o.user >= s.users) {
    throw Error(ExitCode::usage,
                fmt::format("--user {}: {} user{} take part in {}; users count from 0, more take part with --users",
                            o.user, s.users, s.users == 1 ? "" : "s", o.scene));
  }
  return scene;
}

std::vector<std::string> flags_of(const Options& o) {
  std::vector<std::string> flags{o.scene};
  const auto add = [&](const char* flag, const auto& value) {
    if (value) flags.insert(flags.end(), {flag, fmt::format("{}", *value)});
  };
  add("--mode", o.mode);
  add("--scheme", o.scheme);
  add("--latency", o.latency_s);
  add("--jitter", o.jitter_s);
  add("--device-latency", o.device_latency_s);
  add("--loss", o.loss_ratio);
  add("--passivity", o.passivity);
  if (!o.disabled.empty()) flags.insert(flags.end(), {"--disable", fmt::format("{}", fmt::join(o.disabled, ","))});
  add("--engine", o.engine);
  add("--haptic-engine", o.haptic_engine);
  add("--preset", o.preset);
  add("--haptic-preset", o.haptic_preset);
  add("--ratio", o.ratio);
  add("--users", o.users);
  add("--budget", o.budget_ratio);
  add("--duration", o.duration_s);
  if (!o.network.peers.empty())
    flags.insert(flags.end(), {"--peers", fmt::format("{}", fmt::join(o.network.peers, ","))});
  if (!o.network.interface_address.empty()) flags.insert(flags.end(), {"--interface", o.network.interface_address});
  if (!o.network.qos_file.empty()) flags.insert(flags.end(), {"--qos", o.network.qos_file});
  if (!o.out.empty()) flags.insert(flags.end(), {"--out", o.out});
  flags.insert(flags.end(), {"--wait", fmt::format("{}", o.wait_s)});
  return flags;
}

int guarded(const char* program, const std::function<int()>& body) noexcept {
  try {
    return body();
  } catch (const Error& wrong) {
    fmt::print(stderr, "{}: error: {}\n", program, wrong.what());
    return static_cast<int>(wrong.code());
  } catch (const std::exception& wrong) {
    fmt::print(stderr, "{}: error: {}\n", program, wrong.what());
    return static_cast<int>(ExitCode::failed);
  }
}

int run_program(Program program, int argc, const char* const* argv,
                const std::function<void(const Options&, const Scene&)>& body) noexcept {
  return guarded(about(program).name, [&] {
    const Parsed parsed = parse_options(program, argc, argv);
    if (parsed.exit_code) return *parsed.exit_code;
    end_at_stop_signals();
    if (const std::vector<int>& cores = parsed.options.cores; !cores.empty() && !keep_to_cores(cores))
      throw Error(ExitCode::usage, fmt::format("--core {}: this machine does not have it, or not for this program",
                                               fmt::join(cores, ",")));
    std::setvbuf(stdout, nullptr, _IOLBF, 0);  // a log holds what was said, however the program ends
    const Scene scene = load_scene(parsed.options);
    if (!parsed.options.out.empty()) make_folder(parsed.options.out);
    body(parsed.options, scene);
    return static_cast<int>(ExitCode::done);
  });
}

}  // namespace subworld
