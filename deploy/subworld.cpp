#include "commands.hpp"
#include "io/output.hpp"
#include "link/command.hpp"
#include "model/error.hpp"
#include "physics/plugin.hpp"
#include "report/page.hpp"
#include "results/command.hpp"
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
