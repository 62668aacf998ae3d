#include "io/options/options.hpp"

#include "io/options/scene_name.hpp"
#include "io/results/output.hpp"
#include "io/results/results.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "model/slips.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>
#include <sys/resource.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <new>

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
       "  world_sim heap --mode lockstep --duration 5\n"
       "On two hosts, this one with the world and interface eth0, 10.0.0.2 with the user; all programs get the same\n"
       "scene and flags:\n"
       "  world_sim heap --mode realtime --dds cyclonedds --domain 7 --interface eth0 --peers 10.0.0.2\n"},
      {"haptic_sim", "Simulates one user's haptic sub-world at the haptic rate and couples it to the device.",
       "Examples:\n"
       "  haptic_sim heap --user 0\n"
       "On two hosts, this one with the user and interface eth0, 10.0.0.1 with the world; all programs get the same\n"
       "scene and flags:\n"
       "  haptic_sim heap --mode realtime --dds cyclonedds --domain 7 --interface eth0 --peers 10.0.0.1 --user 0\n"
       "  device_sim heap --mode realtime --dds cyclonedds --domain 7 --interface eth0 --peers 10.0.0.1 --user 0\n"},
      {"device_sim", "Connects one user's haptic device, or emulates it and its operator.",
       "Examples:\n"
       "  device_sim heap --user 0\n"
       "On two hosts, this one with the user and interface eth0, 10.0.0.1 with the world; all programs get the same\n"
       "scene and flags:\n"
       "  device_sim heap --mode realtime --dds cyclonedds --domain 7 --interface eth0 --peers 10.0.0.1 --user 0\n"},
      {"gui_headless", "Watches a run without a window and writes a picture of it.",
       "Examples:\n"
       "  gui_headless heap --out out/heap\n"
       "  gui_headless heap --live 8765                       # then open ws://127.0.0.1:8765 in Lichtblick\n"
       "On two hosts, this one with interface eth0, 10.0.0.1 with the world:\n"
       "  gui_headless heap --mode realtime --dds cyclonedds --domain 7 --interface eth0 --peers 10.0.0.1 --out "
       "out\n"}};
  return kAbout[static_cast<std::size_t>(program)];
}

void add_setting(CommandLine& line, const Setting& setting, std::optional<std::string>& target) {
  Option option = line.add(std::string(setting.option), &target, std::string(setting.meaning));
  option.otherwise("the scene's, else " + default_text(setting));
  if (!setting.range.words.empty()) {
    option.one_of({setting.range.words.begin(), setting.range.words.end()});
    return;
  }
  option.range(setting.range.limits.least, setting.range.limits.most, std::string(setting.unit()));
  option.check([key = setting.key](const std::string& text) { return setting_fault(SettingChange{key, text}); });
}

}  // namespace

void change(Options& o, const std::string& key, const std::string& value) { o.set.push_back(key + "=" + value); }

std::string flag_of(const Options& o, std::string_view key) {
  const Setting* const setting = find_setting(key);
  for (const std::string& text : o.set) {
    if (find_setting(parse_change(text).key) == setting) return fmt::format("--set {}", key);
  }
  const auto named = o.named.find(key);
  return named != o.named.end() && named->second ? std::string(setting->option) : "";
}

/// Where a variable of the shell is not set, a run must not start without security.
std::string folder_fault(const std::string& text) { return text.empty() ? "names no folder" : ""; }

void add_set_option(CommandLine& line, std::vector<std::string>& set) {
  line.add("--set", &set,
           "KEY=VALUE: any setting by its key in the scene file, as in deadband=0.1, users.box_half_m=0.3 or, for one "
           "user, users[1].box_half_m=0.3; `subworld plan SCENE --settings` lists all; may be repeated")
      .whole()
      .check([](const std::string& text) { return setting_fault(parse_change(text)); })
      .otherwise("the scene's settings");
}

void add_run_options(CommandLine& line, Options& o) {
  const auto add = [&](const char* name, OptionTarget target, const char* what) -> Option& {
    return o.shared.emplace_back(line.add(name, target, what));
  };
  line.add("scene", &o.scene, "scene file (YAML), or the name of a scene of Subworld").required();
  for (const Setting& setting : settings_table()) {
    if (!setting.option.empty()) add_setting(line, setting, o.named[setting.key]);
  }
  add_set_option(line, o.set);
  add("--interface", &o.network.interface_address,
      "own network interface, by name or IPv4 address; other hosts are reached with --peers too")
      .otherwise("loopback, which reaches this host only");
  add("--peers", &o.network.peers,
      "other hosts of the run: IPv4 addresses or names, separated by commas; needs --interface")
      .otherwise("this host");
  add("--host-users", &o.network.host_users,
      "users whose programs run on one host of the run, at most: discovery asks fewer ports")
      .range(1, kMostUsers)
      .otherwise("all users");
  add("--qos", &o.network.qos_file, "the DDS vendor's settings file")
      .otherwise("the vendor's environment variable, else qos/VENDOR.xml beside the programs");
  add("--secure", &o.network.secure,
      "folder of `subworld keys make`: the programs prove their roles to each other, and hear no other program")
      .check(folder_fault)
      .otherwise("no security");
  add("--wait", &o.wait_s, "longest wait for the other programs").range(0.1, 3600.0, "s");
}

Option add_out(CommandLine& line, Options& o, const char* what) { return line.add("--out", &o.out, what); }

Option add_dds(CommandLine& line, std::string& dds, const std::vector<std::string>& vendors) {
  return line.add("--dds", &dds, "DDS vendor").one_of(vendors).environment("SUBWORLD_DDS");
}

Option add_domain(CommandLine& line, int& domain) {
  return line.add("--domain", &domain, "DDS domain").range(0, 232).environment("SUBWORLD_DOMAIN");
}

void add_device_options(CommandLine& line, Options& o) {
  line.add(
          "--device", &o.devices,
          "haptic device: emulated, browser (the page of the run; implies --mode realtime, --page and --duration 600), "
          "udp, spacemouse, joystick or another driver (`subworld device list`); with several users a list, one for "
          "each")
      .otherwise("emulated");
  line.add("--device-settings", &o.device_settings, "settings of the device's driver; see `subworld device list`")
      .otherwise("the driver's");
  line.add("--device-scale", &o.device_scale_ratio, "metres in the scene for a metre of a device with a driver")
      .range(0.01, 100.0);
  line.add("--device-declutch", &o.device_declutch,
           "button of a device with a driver: while it is pressed, the device moves without the proxy; -1: none")
      .range(-1, 31);
}

bool imply_browser(Options& o) {
  if (std::ranges::find(o.devices, kBrowserDevice) == o.devices.end()) return false;
  if (flag_of(o, "mode").empty()) change(o, "mode", "realtime");
  if (flag_of(o, "duration_s").empty()) change(o, "duration_s", "600");  // a person ends it earlier, on the page
  return true;
}

std::vector<std::string> device_flags_of(const Options& o, int user) {
  if (o.devices.empty()) return {};
  const std::size_t at = o.devices.size() == 1 ? 0 : static_cast<std::size_t>(user);
  if (at >= o.devices.size()) {
    throw Error(ExitCode::usage, fmt::format("--device {}: names no device for user {}; name one for each user, or one "
                                             "for all",
                                             joined(o.devices, ","), user));
  }
  return {"--device",          o.devices[at],
          "--device-settings", o.device_settings,
          "--device-scale",    fmt::format("{}", o.device_scale_ratio),
          "--device-declutch", fmt::format("{}", o.device_declutch)};
}

std::vector<std::string> own_flags_of(const Options& o, const std::string& program, int user) {
  if (program == "gui_headless") return live_flags_of(o.live);
  if (program == "device_sim") return device_flags_of(o, user);
  if (program != "world_sim") return {};
  std::vector<std::string> flags{"--checkpoint", fmt::format("{}", o.checkpoint_s)};
  const auto add = [&](const char* name, std::string value) { flags.insert(flags.end(), {name, std::move(value)}); };
  if (o.bodies) add("--bodies", *o.bodies);
  if (o.bodies_rate_hz) add("--bodies-rate", fmt::format("{}", *o.bodies_rate_hz));
  if (!o.without.empty()) add("--without", joined(o.without, ","));
  return flags;
}

void add_trace_option(CommandLine& line, Options& o) {
  line.add("--trace", &o.trace,
           "file for a trace of the loops, stage by stage, as Chrome trace events (Perfetto, chrome://tracing, "
           "speedscope); about 3 MB a second for each user at 1 kHz")
      .otherwise("none");
}

void add_record_option(CommandLine& line, Options& o) {
  line.add("--record", &o.record,
           "file for a recording of all messages, with scene, settings and summary, in the format MCAP; `subworld "
           "replay` reads it")
      .otherwise("none");
}

void add_bodies_options(CommandLine& line, Options& o) {
  const Option bodies = line.add("--bodies", &o.bodies,
                                 "bodies whose states are written to DIR/bodies.csv: names of the scene, separated by "
                                 "commas, patterns such as 'cube*', or all that can move")
                            .otherwise("none");
  line.add("--bodies-rate", &o.bodies_rate_hz, "rate of these states, per simulated second")
      .range(1e-3, 1e6, "Hz")
      .otherwise("each cycle of the world, at most 10,000 rows a second in total")
      .needs(bodies);
}

void add_checkpoint_options(CommandLine& line, Options& o) {
  line.add("--checkpoint", &o.checkpoint_s,
           "real time: simulated time from one checkpoint of the world to the next, written to --out; 0: none")
      .range(0.0, 3600.0, "s");
  line.add("--resume", &o.resume,
           "real time: go on from a checkpoint file, or from the newest valid one in a folder of results")
      .otherwise("start at t = 0");
  line.add("--without", &o.without,
           "real time: users, separated by commas, without whom the run begins; they join when their programs start")
      .range(0, 63)
      .otherwise("wait for all users");
}

namespace {

/// Settings whose use depends on the machine (bench_wake_up measures it), of single programs: also by the environment.
void add_tuning(CommandLine& line, const char* program, Options& o) {
  const auto variable = [&](const char* what) {
    std::string name = fmt::format("SUBWORLD_{}_{}", program, what);
    std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::toupper(c); });
    return name;
  };
  line.add("--core", &o.cores, "").range(0, 1023).environment(variable("core")).hidden();
  line.add("--spin", &o.spin_s, "").range(0.0, 0.01, "s").environment(variable("spin_s")).hidden();
}

}  // namespace

std::vector<std::string> settings_flags_of(const Options& o) {
  std::vector<std::string> flags{o.scene};
  for (const auto& [key, value] : o.named) {
    if (value) flags.insert(flags.end(), {std::string(find_setting(key)->option), *value});
  }
  for (const std::string& text : o.set) flags.insert(flags.end(), {"--set", text});
  for (const Option& option : o.shared) {
    const std::vector<std::string> words = option.as_given();
    flags.insert(flags.end(), words.begin(), words.end());
  }
  return flags;
}

std::vector<std::string> flags_of(const Options& o) {
  std::vector<std::string> flags = settings_flags_of(o);
  if (!o.out.empty()) flags.insert(flags.end(), {"--out", o.out});
  return flags;
}

void add_network(CommandLine& line, Network& network) {
  line.add("--interface", &network.interface_address, "own network interface, by name or IPv4 address")
      .otherwise("loopback, which reaches this host only");
  line.add("--peers", &network.peers, "other hosts of the run: IPv4 addresses or names, separated by commas")
      .otherwise("this host");
  line.add("--secure", &network.secure, "the run's folder of keys").check(folder_fault).otherwise("no security");
}

int guarded(const char* program, const std::function<int()>& body) noexcept {
  outlive_full_output();
  try {
    return body();
  } catch (const Error& wrong) {
    // One without a text has been printed.
    if (*wrong.what() != '\0') fmt::print(stderr, "{}: error: {}\n", program, wrong.what());
    return static_cast<int>(wrong.code());
  } catch (const std::bad_alloc&) {
    fmt::print(stderr, "{}: error: there is too little memory{}\n", program, memory_limit_text());
    return static_cast<int>(ExitCode::failed);
  } catch (const std::filesystem::filesystem_error& wrong) {
    fmt::print(stderr, "{}: error: {}: {}; choose another place, or change the rights\n", program,
               wrong.path1().string(), wrong.code().message());
    return static_cast<int>(ExitCode::failed);
  } catch (const std::exception& wrong) {
    fmt::print(stderr, "{}: error: {}{}\n", program, wrong.what(), memory_limit_text());
    return static_cast<int>(ExitCode::failed);
  }
}

std::string memory_limit_text() {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return {};
  return fmt::format(
      "; a process may use {} kB of memory here, which may be too little: ulimit -v unlimited (or as in "
      "/etc/security/limits.conf)",
      limit.rlim_cur >> 10U);
}

void raise_open_files() {
  constexpr rlim_t kLeast = 64, kEnough = 4096;  // a program with one user has 20 open
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  if (limit.rlim_cur < kEnough) {
    limit.rlim_cur = std::min(limit.rlim_max, kEnough);
    setrlimit(RLIMIT_NOFILE, &limit);
  }
  if (limit.rlim_cur >= kLeast) return;
  throw Error(ExitCode::failed, fmt::format("a process may open {} files here, and a run needs {}; raise the limit: "
                                            "ulimit -n 1024 (or nofile in /etc/security/limits.conf)",
                                            limit.rlim_cur, kLeast));
}

int run_program(Program program, int argc, const char* const* argv,
                const std::function<void(const Options&, const Scene&)>& body) noexcept {
  const About& me = about(program);
  return guarded(me.name, [&] {
    Options o;
    CommandLine line(me.name, me.what);
    line.footer(me.examples);
    add_run_options(line, o);
    add_dds(line, o.network.dds, {"fastdds", "cyclonedds"});
    add_domain(line, o.network.domain);
    if (program == Program::haptic_sim || program == Program::device_sim)
      line.add("--user", &o.user, "the scene's user that it serves, from 0").range(0, 63);
    if (program == Program::device_sim) add_device_options(line, o);
    const bool display = program == Program::gui_headless;
    if (display) o.out = "out/display";
    add_out(line, o, display ? "folder for the pictures" : "folder for results; without it none are written");
    if (!display) add_trace_option(line, o);
    add_tuning(line, me.name, o);
    if (program == Program::world_sim) {
      add_bodies_options(line, o);
      add_checkpoint_options(line, o);
      line.flag("--await-display", o.await_display, "start only when a display is there, so that it misses nothing");
    }
    if (display) {
      line.add("--picture-every", &o.picture_every_s, "a picture also each so many simulated seconds; 0: only the last")
          .range(0.0, 1e6, "s");
      add_live_options(line, o.live,
                       "serves the run to Lichtblick, Foxglove and other viewers on this TCP port; 0: any free one");
    }
    if (const auto code = line.parse(argc, argv)) return *code;
    check_live_options(o.live);
    end_at_stop_signals();
    raise_open_files();
    if (!o.cores.empty() && !keep_to_cores(o.cores))
      throw Error(ExitCode::usage, fmt::format("--core {}: this machine does not have it, or not for this program",
                                               joined(o.cores, ",")));
    std::setvbuf(stdout, nullptr, _IOLBF, 0);  // a log is complete, however the program ends
    const Scene scene = load_scene(o);
    if (!o.out.empty()) make_folder(o.out);
    body(o, scene);
    return static_cast<int>(ExitCode::done);
  });
}

}  // namespace subworld
