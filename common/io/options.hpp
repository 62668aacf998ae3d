#pragma once

#include "model/network.hpp"
#include "model/scene.hpp"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

enum class Program : std::uint8_t { world_sim, haptic_sim, device_sim, gui_headless };

/// What every program takes from its command line. Flag over environment over scene over default.
struct Options {
  std::string scene;
  Network network;
  std::optional<std::string> mode;
  std::optional<std::string> scheme;
  std::optional<double> latency_s;
  std::optional<double> jitter_s;
  std::optional<double> device_latency_s;
  std::optional<double> loss_ratio;
  std::optional<std::string> passivity;
  std::vector<std::string> disabled;  ///< parse_disabled() reads it
  std::optional<std::string> engine;
  std::optional<std::string> haptic_engine;
  std::optional<std::string> preset;
  std::optional<std::string> haptic_preset;
  std::optional<std::string> ratio;  ///< parse_ratio() reads it
  std::optional<int> users;
  std::optional<double> budget_ratio;
  std::optional<double> duration_s;
  std::string out;                       ///< folder for results; empty: none are written
  std::optional<std::string> bodies;     ///< world_sim: whose states are written down; choose_bodies() reads it
  std::optional<double> bodies_rate_hz;  ///< world_sim: how often
  std::vector<int> cores;                ///< that all threads of the program stay on; none: any
  double spin_s = 0.0;           ///< haptic_sim, device_sim: looks at the clock instead of sleeping before a release
  std::string trace;             ///< file for what the loops did when; empty: none. Not of the display
  int user = 0;                  ///< haptic_sim, device_sim
  double wait_s = 30.0;          ///< for the other programs
  double picture_every_s = 0.0;  ///< gui_headless
  bool await_display = false;    ///< world_sim: not before a display looks
};

struct Parsed {
  Options options;
  std::optional<int> exit_code;  ///< set where nothing is left to do (`--help`)
};

/// Reads the command line of a program. Throws `Error` (usage) with the flag and the cure.
[[nodiscard]] Parsed parse_options(Program program, int argc, const char* const* argv);

/// Loads the scene and lets the options override its settings; afterwards `settings.users` counts the users that take
/// part. Throws `Error` (usage).
[[nodiscard]] Scene load_scene(const Options& options);

/// The flags that hand the same settings on to another program.
[[nodiscard]] std::vector<std::string> flags_of(const Options& options);

}  // namespace subworld

namespace CLI {
class App;
}

namespace subworld {

/// Adds the options that the launcher and all programs share.
void add_run_options(CLI::App& app, Options& options);

/// Why a text is no simulation ratio, fixed or as in 4-12, with the cure; empty: it is one.
[[nodiscard]] std::string ratio_fault(const std::string& text);
/// The same for one of a list of fixed ratios, beside an option --ratio-most.
[[nodiscard]] std::string fixed_ratio_fault(const std::string& text);

/// Adds --trace.
void add_trace_option(CLI::App& app, Options& options);

/// Adds --bodies and --bodies-rate.
void add_bodies_options(CLI::App& app, Options& options);

/// Runs a program's body and turns what it throws into a message on stderr and an exit code.
int guarded(const char* program, const std::function<int()>& body) noexcept;

/// A program from its command line to its exit code: options, stop signals, scene, folder for results, body.
int run_program(Program program, int argc, const char* const* argv,
                const std::function<void(const Options&, const Scene&)>& body) noexcept;

}  // namespace subworld
