#include "device.hpp"
#include "doctor/doctor.hpp"
#include "io/command_line.hpp"
#include "io/output.hpp"
#include "launch.hpp"
#include "link/command.hpp"
#include "model/error.hpp"
#include "physics/plugin.hpp"
#include "player.hpp"
#include "replay.hpp"
#include "report/page.hpp"
#include "results/command.hpp"
#include "session/session.hpp"
#include "top.hpp"
#include "wire/plugin.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <vector>

namespace {

using namespace subworld;

struct Lab {
  const char* name;
  const char* about;
};
constexpr std::array kLabs{
    Lab{"coupling", "The error of the felt force against the run time of each coupling scheme"},
    Lab{"engines", "The cost of a step of each physics engine, and whether structures stand"},
    Lab{"stability", "The distance of each engine from formulas and limits of mechanics, with margins"},
    Lab{"plan", "The time that each optimisation saves, and the difference that it makes"},
    Lab{"latency", "The largest delay that a user does not feel"},
    Lab{"network", "The loss, delay and gaps of messages over a network, for each vendor and service"}};

constexpr const char* kExamples =
    "Examples:\n"
    "  subworld run deploy/scenes/heap.yaml --mode realtime --duration 20 --gui\n"
    "  subworld run deploy/scenes/heap.yaml --mode realtime --duration 60 --page\n"
    "  subworld run press --device browser\n"
    "  subworld run deploy/scenes/heap.yaml --mode lockstep --duration 5 --dds mixed\n"
    "  subworld run deploy/scenes/heap.yaml --users 2\n"
    "  subworld run row --bodies 'cube*,user/proxy' --bodies-rate 50\n"
    "  subworld control pause --domain 100\n"
    "  subworld control engine havok --haptic --domain 100\n"
    "  subworld plan deploy/scenes/row.yaml\n"
    "  subworld link wifi --validate\n"
    "  subworld device list\n"
    "  subworld doctor\n"
    "  subworld top\n"
    "  subworld report out/row\n"
    "  subworld lab coupling --quick\n"
    "`subworld run` starts all programs on this host, `subworld up` those of a session on several hosts.\n"
    "Exit codes: 0 done (also SIGINT, SIGTERM), 1 failed while running, 2 usage or scene, 3 middleware,\n"
    "            4 a quality gate was missed (--strict).";

void add_restart(CommandLine& line, std::string& restart) {
  line.add(
          "--restart", &restart,
          "real time: starts a program again that ends before the run: on-failure where it was killed, is halted for a "
          "second or fails; always also where it was asked to end")
      .one_of({"never", "on-failure", "always"});
}

Restart restart_of(const std::string& word) {
  if (word == "always") return Restart::always;
  return word == "on-failure" ? Restart::on_failure : Restart::never;
}

void add_run(CommandLine& line, RunRequest& request, std::string& placement, std::string& restart) {
  add_run_options(line, request.options);
  add_dds(line, request.dds, {"fastdds", "cyclonedds", "mixed"});
  add_domain(line, request.domain).otherwise("the first from 100 down to 60 that no other run on this host uses");
  add_out(line, request.options, "folder for results").otherwise("a new out/SCENE-TIME");
  line.flag("--gui", request.gui, "also start the display, which writes a picture");
  line.flag("--page", request.page,
            "also start the display and serve a page that shows the run in a browser; prints the address, and opens it "
            "on a desktop");
  add_live_options(line, request.options.live,
                   "also start the display, and serve the run to Lichtblick and Foxglove on this TCP port");
  add_device_options(line, request.options);
  add_bodies_options(line, request.options);
  add_checkpoint_options(line, request.options);
  add_record_option(line, request.options);
  add_trace_option(line, request.options);
  line.add("--placement", &placement,
           "real time: auto gives the world a core of its own where the others have room for the haptic loops; none "
           "leaves it to the OS, which is better where several runs share the machine")
      .one_of({"auto", "none"})
      .environment("SUBWORLD_PLACEMENT");
  add_restart(line, restart);
  line.flag("--explain", request.explain,
            "also explain the result in plain words, with what to look at and to try next");
  line.flag("--strict", request.strict, "exit code 4 where a quality gate is missed, also by the OS");
}

void add_up(CommandLine& line, SessionRequest& request, std::string& restart) {
  line.add("session", &request.session, "session file (YAML), or the name of a session in deploy/sessions").required();
  const Option host = line.add("--host", &request.host, "start only the programs of this host, here").otherwise("all");
  line.flag("--namespaces", request.namespaces,
            "make each host a network namespace of this machine; needs the rights of root");
  line.add("--link", &request.link, "with --namespaces: the link between any two hosts, as for `subworld link`")
      .otherwise("the session's");
  line.add("--seed", &request.seed, "with --namespaces: of the link's random draws; netem has its own");
  line.add("--dds", &request.dds, "DDS vendor; mixed alternates over the programs")
      .one_of({"fastdds", "cyclonedds", "mixed"})
      .otherwise("the session's");
  line.add("--ssh", &request.ssh, "program that starts commands on the hosts which have `ssh`");
  line.add("--out", &request.out, "folder for the results").otherwise("a new out/SESSION-TIME");
  add_restart(line, restart);
  line.flag("--explain", request.explain, "also explain the result in plain words");
  line.flag("--strict", request.strict, "exit code 4 where a quality gate is missed, also by the OS");
  line.footer(
      "Examples:\n"
      "  subworld up three_hosts --namespaces\n"
      "  subworld up my_session.yaml\n"
      "  subworld up my_session.yaml --host left");
}

void add_collect(CommandLine& line, CollectRequest& request) {
  line.add("folder", &request.folders, "folders that the programs of one run wrote to").required();
  line.add("--scene", &request.scene, "the scene's file").otherwise("where it lay on the world's host");
  line.add("--out", &request.out, "folder for the summary").otherwise("a new out/SCENE-TIME");
  line.flag("--explain", request.explain, "also explain the result in plain words");
  line.flag("--strict", request.strict, "exit code 4 where a quality gate is missed, also by the OS");
  line.footer("Examples:\n  subworld collect out/a out/b");
}

void add_device_check(CommandLine& line, std::string& name, DriverCheckRequest& request) {
  line.add("name", &name, "driver, as `subworld device list` names it").required();
  line.add("--device-settings", &request.settings, "settings of the driver").otherwise("the driver's");
  line.add("--user", &request.user, "user whom the device serves").range(0, static_cast<int>(kMostUsers) - 1);
  line.add("--duration", &request.duration_s, "time in which the device is read").range(0.3, 3600.0, "s");
  line.footer(
      "Examples:\n"
      "  subworld device check udp\n"
      "Exit codes: 0 all properties hold, 4 one is missed, 2 usage.");
}

/// `network.domain` and `network.dds` have options of their own, because their defaults differ.
void add_network(CommandLine& line, Network& network) {
  line.add("--interface", &network.interface_address, "own network interface, by name or IPv4 address")
      .otherwise("loopback, which reaches this host only");
  line.add("--peers", &network.peers, "other hosts of the run: IPv4 addresses or names, separated by commas")
      .otherwise("this host");
}

void add_replay(CommandLine& line, ReplayRequest& request) {
  line.add("file", &request.file, "recording, as `subworld run --record` writes it").required();
  line.flag("--resimulate", request.resimulate,
            "run the recorded scene again with the recorded settings, and compare the state hashes; of a recording "
            "in lock-step");
  line.flag("--publish", request.publish,
            "publish the recorded messages through DDS, in the place of the programs that were recorded");
  line.flag("--page", request.page, "the same, with a display that serves the page; prints the address");
  add_live_options(line, request.live,
                   "publish the recording, and serve it to Lichtblick and Foxglove on this TCP port");
  line.add("--speed", &request.speed, "simulated time per time").range(Player::kLeastSpeed, Player::kMostSpeed);
  line.add("--from", &request.from_s, "first moment, simulated time").range(0.0, 1e6, "s");
  line.flag("--paused", request.paused, "begin paused: `subworld control step` advances to the next snapshot");
  add_dds(line, request.network.dds, {"fastdds", "cyclonedds"});
  line.add("--domain", &request.domain, "DDS domain")
      .range(0, 232)
      .environment("SUBWORLD_DOMAIN")
      .otherwise("the first from 100 down to 60 that no other run on this host uses");
  add_network(line, request.network);
  line.add("--out", &request.out, "folder for the results").otherwise("a new out/replay-TIME");
  line.footer(
      "Examples:\n"
      "  subworld replay run.mcap\n"
      "  subworld replay run.mcap --resimulate\n"
      "  subworld replay run.mcap --page --speed 0.5\n"
      "  subworld replay run.mcap --publish --paused --domain 100\n"
      "Without an option it prints what the file holds.\n"
      "Exit codes: 0 done, 1 the state hashes differ, 2 usage or no finished recording.");
}

struct ControlRequest {
  Network network;
  std::string verb;
  EngineOrder engine;
  std::optional<int> user;
  std::optional<double> time_s;
  std::optional<double> speed;
  std::string ratio;
  bool haptic = false;
  double wait_s = 5.0;
};

void add_control(CommandLine& line, ControlRequest& request) {
  line.add("verb", &request.verb, "the order")
      .one_of({"stop", "pause", "resume", "step", "leave", "engine", "ratio", "seek", "speed"})
      .required();
  line.add("engine", &request.engine.engine, "for the order engine: the engine to change to");
  line.add("--preset", &request.engine.preset, "preset of that engine");
  line.add("--user", &request.user, "for the order leave: the user's number")
      .range(0, static_cast<int>(kMostUsers) - 1);
  line.add("--time", &request.time_s, "for the order seek, which a replay executes: the moment to move to")
      .range(0.0, 1e6, "s");
  line.add("--speed", &request.speed, "for the order speed, which a replay executes: simulated time per time")
      .range(Player::kLeastSpeed, Player::kMostSpeed);
  line.add("--ratio", &request.ratio, "for the order ratio: bounds within those that the run was started with")
      .check(ratio_fault);
  line.flag("--haptic", request.haptic, "change the sub-worlds' engine instead of the world's");
  add_domain(line, request.network.domain).required();
  add_dds(line, request.network.dds, {"fastdds", "cyclonedds"});
  add_network(line, request.network);
  line.add("--wait", &request.wait_s, "longest wait for the world, and then for its answer").range(0.1, 3600.0, "s");
  line.footer(
      "Examples:\n"
      "  subworld control pause --domain 100\n"
      "  subworld control engine bullet_float --domain 100\n"
      "  subworld control engine havok --haptic --domain 100\n"
      "  subworld control leave --user 1 --domain 100\n"
      "  subworld control ratio --ratio 4-8 --domain 100\n"
      "  subworld control seek --time 1.5 --domain 100\n"
      "  subworld control stop --domain 70 --interface eth0 --peers 10.0.0.2\n"
      "`subworld top` shows the domains in use.\n"
      "Exit codes: 0 done, 1 refused or not executed in time, 2 usage, 3 no world on the domain.");
}

void control(ControlRequest& request) {
  if ((request.verb == "engine") == request.engine.engine.empty()) {
    throw Error(ExitCode::usage, request.verb == "engine"
                                     ? "control engine needs a name, for example: subworld control engine bullet_float"
                                     : fmt::format("control {} takes no \"{}\"", request.verb, request.engine.engine));
  }
  if ((request.verb == "leave") != request.user.has_value())
    throw Error(ExitCode::usage, "--user belongs to `control leave`, which needs it: subworld control leave --user 1");
  if ((request.verb == "seek") != request.time_s.has_value())
    throw Error(ExitCode::usage, "--time belongs to `control seek`, which needs it: subworld control seek --time 1.5");
  if ((request.verb == "speed") != request.speed.has_value())
    throw Error(ExitCode::usage,
                "--speed belongs to `control speed`, which needs it: subworld control speed --speed 2");
  if ((request.verb == "ratio") == request.ratio.empty())
    throw Error(ExitCode::usage,
                "--ratio belongs to `control ratio`, which needs it: subworld control ratio --ratio 4-8");
  if (request.haptic) request.engine.target = EngineOrder::Target::haptic;
  std::string argument = request.ratio;
  if (request.verb == "engine") argument = to_text(request.engine);
  if (request.user) argument = std::to_string(*request.user);
  if (request.time_s) argument = fmt::format("{}", *request.time_s);
  if (request.speed) argument = fmt::format("{}", *request.speed);
  send_control(request.network, request.verb, argument, request.verb == "engine" && request.haptic, request.wait_s);
}

void add_doctor(CommandLine& line, doctor::Request& request) {
  line.add("scene", &request.scene, "scene that is to run: its users and engines are examined too").otherwise("none");
  line.add("--domain", &request.domain, "DDS domain")
      .range(0, 232)
      .environment("SUBWORLD_DOMAIN")
      .otherwise("that of the run on this machine");
  add_dds(line, request.dds, {"fastdds", "cyclonedds", "mixed"});
  add_network(line, request.network);
  line.add("--qos", &request.network.qos_file, "the DDS vendor's settings file")
      .otherwise("the vendor's environment variable, else qos/VENDOR.xml beside the programs");
  line.add("--out", &request.out, "folder for results of a run").otherwise("out");
  line.flag("--verbose", request.verbose, "also list all checks, and what was measured");
  line.flag("--json", request.json, "print one JSON object: healthy, checks, findings, remarks");
  line.footer(
      "Examples:\n"
      "  subworld doctor\n"
      "  subworld doctor heap --domain 70 --verbose\n"
      "  subworld doctor --domain 70 --interface eth0 --peers 10.0.0.2\n"
      "Each finding has a cure: a command for the shell that the doctor was started from.\n"
      "Exit codes: 0 healthy, 4 something was found, 2 usage or scene.");
}

void add_top(CommandLine& line, TopRequest& request) {
  line.add("--domain", &request.domain, "DDS domain")
      .range(0, 232)
      .environment("SUBWORLD_DOMAIN")
      .otherwise("all that programs of this machine use");
  add_dds(line, request.network.dds, {"fastdds", "cyclonedds"});
  add_network(line, request.network);
  line.flag("--once", request.once, "print one table and end; so it does where the output is no terminal");
  line.footer(
      "Examples:\n"
      "  subworld top\n"
      "  subworld top --once\n"
      "  subworld top --domain 70 --interface eth0 --peers 10.0.0.2\n"
      "q or Ctrl-C ends. MISSED are deadlines, in brackets those by the OS; FACTOR is the world's real-time factor.");
}

/// The engines and DDS vendors that are installed, with their versions, for --version.
std::string part_versions() {
  std::string text;
  for (const std::string& name : engine_names()) {
    std::string version = "cannot be loaded";
    try {
      version = engine_plugin(name).version;
    } catch (const Error&) {
      // A run with this engine reports the cause.
    }
    text += fmt::format("engine {}: {}\n", name, version);
  }
  for (const Vendor vendor : {Vendor::fastdds, Vendor::cyclonedds}) {
    const std::string version = wire::installed_version(vendor);
    text += fmt::format("DDS {}: {}\n", name_of(vendor), version.empty() ? "not installed" : version);
  }
  if (text.ends_with('\n')) text.pop_back();
  return text;
}

bool is_lab(const std::string& name) {
  return std::ranges::any_of(kLabs, [&](const Lab& lab) { return name == lab.name; });
}

/// Becomes another program of the build. `arguments` end with a null, the first is the program's own name.
void become(const std::string& name, char** arguments) {
  const std::string program = program_folder() + "/" + name;
  execv(program.c_str(), arguments);
  throw Error(ExitCode::failed,
              fmt::format("{}: cannot start ({}); build it with deploy/build", program, std::strerror(errno)));
}

/// A lab writes the page of its folder itself.
void report(const ReportRequest& request) {
  const ReportPlace place = place_of(request);
  if (place.lab.empty()) return write_report(place);
  if (!is_lab(place.lab))
    throw Error(ExitCode::failed, fmt::format("{}: no lab is called \"{}\"", place.folder, place.lab));
  std::vector<std::string> words{"lab_" + place.lab, kWriteReport, place.folder, place.page};
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  become(words.front(), arguments.data());
}

int main_of(int argc, char** argv) {
  CommandLine line("subworld", "Distributed haptic simulation: starts, watches and stops the programs of a run.");
  line.footer(kExamples);
  line.version(part_versions);

  RunRequest request;
  std::string placement = "auto", restart = "never";
  CommandLine& run_command = line.command("run", "Runs a scene: one world, and a haptic and a device process per user");
  add_run(run_command, request, placement, restart);

  RunRequest plan_request;
  CommandLine& plan_command = line.command(
      "plan", "Reads a scene, warns of problems, and lists the optimisations that are on or off, with reasons");
  add_run_options(plan_command, plan_request.options);
  plan_command.flag("--gui", plan_request.gui, "with the display");

  ControlRequest control_request;
  ReplayRequest replay_request;
  CommandLine& replay_command =
      line.command("replay", "Shows what a recording holds, publishes it, and re-simulates it");
  add_replay(replay_command, replay_request);
  line.command("film", "Makes pictures, and a video, of a recording: any moment, camera and speed").takes_all();

  CommandLine& control_command =
      line.command("control", "Stops, pauses, resumes or steps a running world, or changes its engine");
  add_control(control_command, control_request);

  SessionRequest session;
  CommandLine& up_command = line.command("up", "Runs a session: the programs of one run on several hosts");
  add_up(up_command, session, restart);

  CollectRequest collection;
  CommandLine& collect_command =
      line.command("collect", "Makes one summary and verdict of results that programs wrote into several folders");
  add_collect(collect_command, collection);

  std::string driver;
  DriverCheckRequest driver_request;
  CommandLine& device_command = line.command("device", "Lists the drivers of haptic devices, or examines one");
  CommandLine& list_command = device_command.command("list", "Lists the drivers and their settings");
  CommandLine& check_command = device_command.command("check", "Examines a driver; move its device meanwhile");
  add_device_check(check_command, driver, driver_request);

  LinkRequest link_request;
  CommandLine& link_command =
      line.command("link", "Emulates a network between hosts on this machine: delay, jitter, loss, rate, outage");
  add_link_options(link_command, link_request);
  doctor::Request doctor_request;
  CommandLine& doctor_command =
      line.command("doctor", "Examines this machine, its network and a running domain; names faults with their cures");
  add_doctor(doctor_command, doctor_request);

  TopRequest top_request;
  CommandLine& top_command =
      line.command("top", "Shows the domains in use, their programs, rates and missed deadlines");
  add_top(top_command, top_request);

  ReportRequest report_request;
  CommandLine& report_command =
      line.command("report", "Writes one page on a run, a session or a lab from its folder: figures, verdict, plots");
  add_report_options(report_command, report_request);

  CommandLine& lab_command = line.command("lab", "Evaluations: runs a sweep and writes tables and a report");
  lab_command.footer(
      "Examples:\n"
      "  subworld lab coupling --quick --out out/quick\n"
      "  subworld lab coupling row --ratio 1,4,10,20 --out out/row\n"
      "  subworld lab engines --quick --out out/engines\n"
      "  subworld lab stability --quick --out out/stability\n"
      "  subworld lab plan --quick --out out/plan\n"
      "  subworld lab latency row --out out/latency\n"
      "  subworld lab coupling --help");
  for (const Lab& lab : kLabs) lab_command.command(lab.name, lab.about).takes_all();

  if (argc > 2 && std::string_view(argv[1]) == "lab" && is_lab(argv[2]))
    become(std::string("lab_") + argv[2], argv + 2);
  if (argc > 1 && std::string_view(argv[1]) == "film") become("film", argv + 1);
  if (const auto code = line.parse(argc, argv)) return *code;
  request.command_line = session.command_line = collection.command_line =
      fmt::format("{}", fmt::join(argv, argv + argc, " "));
  request.restart = session.restart = restart_of(restart);
  if (up_command.chosen()) return up(session);
  if (collect_command.chosen()) return collect(collection);
  if (run_command.chosen()) {
    request.place = placement == "auto";
    request.page |= imply_browser(request.options);
    if (request.page && !request.options.live.port) request.options.live.port = 0;
    request.gui |= request.options.live.port.has_value();
    check_live_options(request.options.live);
    // For the display; on its command line others could read the token.
    if (const std::string& token = request.options.live.token; !token.empty()) setenv(kTokenVariable, token.c_str(), 1);
    return run(request);
  }
  if (replay_command.chosen()) {
    check_live_options(replay_request.live);
    return replay(replay_request);
  }
  if (check_command.chosen()) return check_device(driver, driver_request);
  if (list_command.chosen()) {
    list_devices();
    return static_cast<int>(ExitCode::done);
  }
  if (link_command.chosen()) return run_link(link_request);
  if (doctor_command.chosen()) return doctor::run(doctor_request);
  if (top_command.chosen()) {
    show_top(top_request);
  } else if (report_command.chosen()) {
    report(report_request);
  } else if (control_command.chosen()) {
    control(control_request);
  } else {
    print_plan(plan_request);
  }
  return static_cast<int>(ExitCode::done);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace subworld;
  const int code = guarded("subworld", [&] { return main_of(argc, argv); });
  const std::string lost = lost_output();
  if (lost.empty()) return code;
  fmt::print(stderr, "subworld: error: {}\n", lost);
  return code == static_cast<int>(ExitCode::done) ? static_cast<int>(ExitCode::failed) : code;
}
