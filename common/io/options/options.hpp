#pragma once

#include "io/options/command_line.hpp"
#include "io/options/live_options.hpp"
#include "model/settings/network.hpp"
#include "model/settings/settings.hpp"

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

enum class Program : std::uint8_t { world_sim, haptic_sim, device_sim, gui_headless };

/// The options of every program. A flag wins over the environment, that over the scene, and that over the default.
struct Options {
  std::string scene;
  Network network;
  std::map<std::string, std::optional<std::string>, std::less<>> named;  ///< settings by their short forms
  std::vector<std::string> set;                                          ///< settings by --set, as KEY=VALUE
  std::string out;                       ///< folder for results; empty: none are written
  std::optional<std::string> bodies;     ///< world_sim: bodies to record; choose_bodies() reads it
  std::optional<double> bodies_rate_hz;  ///< world_sim: rate of that
  double checkpoint_s = 0.5;             ///< world_sim: simulated time between checkpoints; 0: none
  std::string resume;                    ///< world_sim: file or folder of the checkpoint to go on from; empty: none
  std::vector<int> without;              ///< users without whom the world begins; they may join later
  std::vector<int> cores;                ///< for all threads of the program; none: any
  double spin_s = 0.0;                   ///< haptic_sim, device_sim: spins instead of sleeping before a release
  std::string record;                    ///< of `subworld run`: file for a recording; empty: none
  std::string trace;                     ///< file for a trace of the loops; empty: none. Not of the display
  int user = 0;                          ///< haptic_sim, device_sim
  std::vector<std::string> devices;      ///< device_sim: its device; the launcher: one for each user. None: emulated
  std::string device_settings;           ///< of the device's driver
  double device_scale_ratio = 1.0;       ///< metres in the scene for a metre of the device
  int device_declutch = -1;              ///< button of the device that disengages it from the proxy; -1: none
  double wait_s = 30.0;                  ///< for the other programs
  std::vector<Option> shared = {};       ///< further options that all programs of a run have
  double picture_every_s = 0.0;          ///< gui_headless
  LiveOptions live = {};                 ///< gui_headless
  bool await_display = false;            ///< world_sim: starts when a display is there
};

/// Sets a setting, as --set does.
void change(Options& options, const std::string& key, const std::string& value);
/// The option that sets a setting: "--scheme" or "--set scheme"; empty: none does.
[[nodiscard]] std::string flag_of(const Options& options, std::string_view key);

/// Loads the scene and lets the options override its settings; afterwards `settings.users` counts the users that take
/// part. Throws `Error` (usage).
[[nodiscard]] Scene load_scene(const Options& options);

/// The scene and the flags that give the same settings to another program.
[[nodiscard]] std::vector<std::string> settings_flags_of(const Options& options);
/// The same with the folder for results.
[[nodiscard]] std::vector<std::string> flags_of(const Options& options);

/// Adds --set.
void add_set_option(CommandLine& line, std::vector<std::string>& set);
/// Adds the options that the launcher and all programs share: the short forms of settings, --set, and the network.
void add_run_options(CommandLine& line, Options& options);
Option add_out(CommandLine& line, Options& options, const char* what);
/// Adds --dds and --domain.
Option add_dds(CommandLine& line, std::string& dds, const std::vector<std::string>& vendors);
Option add_domain(CommandLine& line, int& domain);

/// Adds --device, --device-settings, --device-scale and --device-declutch.
void add_device_options(CommandLine& line, Options& options);

/// The device that is a page of the run.
inline constexpr const char* kBrowserDevice = "browser";
/// Whether a user has it; then the run is in real time, and long, where the options do not say otherwise.
bool imply_browser(Options& options);

/// The same options for the device of one user. Throws `Error` (usage) where the list has another length.
[[nodiscard]] std::vector<std::string> device_flags_of(const Options& options, int user);

/// Adds --trace.
void add_trace_option(CommandLine& line, Options& options);

/// Adds --record.
void add_record_option(CommandLine& line, Options& options);

/// The flags that one program of a run has and the others do not; `user`: -1 where it has none.
[[nodiscard]] std::vector<std::string> own_flags_of(const Options& options, const std::string& program, int user);

/// Adds --bodies and --bodies-rate.
void add_bodies_options(CommandLine& line, Options& options);

/// Adds --checkpoint, --resume and --without.
void add_checkpoint_options(CommandLine& line, Options& options);
/// Throws `Error` (usage) where --without names a user that the run does not have, or every user, or in lock-step.
void check_without(const Options& options, const Scene& scene);

/// --interface and --peers.
void add_network(CommandLine& line, Network& network);

/// Runs a program's body and turns its exceptions into a message on stderr and an exit code.
int guarded(const char* program, const std::function<int()>& body) noexcept;

/// "; a process may use 300000 kB of memory here ..." with the cure; empty where no limit is set.
[[nodiscard]] std::string memory_limit_text();

/// Raises the number of files that this process, and those that it starts, may open, as far as the system allows.
/// Throws `Error` (failed) where a run would fail for it: a library names another cause then.
void raise_open_files();

/// A program from its command line to its exit code: options, stop signals, scene, folder for results, body.
int run_program(Program program, int argc, const char* const* argv,
                const std::function<void(const Options&, const Scene&)>& body) noexcept;

}  // namespace subworld
