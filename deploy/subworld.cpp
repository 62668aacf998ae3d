#include "commands.hpp"
#include "io/results/output.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "physics/plugin.hpp"
#include "plan/limits.hpp"
#include "tools.hpp"
#include "wire/plugin.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <string_view>
#include <vector>

namespace {

using namespace subworld;

constexpr const char* kExamples =
    "Examples:\n"
    "  subworld run heap --mode realtime --duration 20 --gui\n"
    "  subworld run heap --mode realtime --duration 60 --page\n"
    "  subworld run press --device browser\n"
    "  subworld run heap --mode lockstep --duration 5 --dds mixed\n"
    "  subworld run heap --users 2\n"
    "  subworld run row --bodies 'cube*,user/proxy' --bodies-rate 50\n"
    "  subworld control pause --domain 100\n"
    "  subworld control engine havok --haptic --domain 100\n"
    "  subworld plan row\n"
    "  subworld link wifi\n"
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

/// Becomes the program of a tool or a lab where the command line names one.
void become_program(int argc, char** argv) {
  if (argc > 2 && std::string_view(argv[1]) == "lab" && is_lab(argv[2]))
    become(std::string("lab_") + argv[2], argv + 2);
  if (argc > 1 && is_tool(argv[1])) become(std::string("subworld_") + argv[1], argv + 1);
}

void add_programs(CommandLine& line) {
  for (const Tool& tool : kTools) line.command(tool.name, tool.about).takes_all();
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
  for (const Tool& lab : kLabs) lab_command.command(lab.name, lab.about).takes_all();
}

/// A file that is opened later must not become a standard stream that the caller has closed.
void reserve_standard_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(stream, F_GETFD) < 0) [[maybe_unused]]
      const int lowest = open("/dev/null", O_RDWR);
  }
}

/// "help run" as "run --help".
std::vector<const char*> words_of(int argc, char** argv) {
  std::vector<const char*> words(argv, argv + argc);
  if (argc > 1 && std::string_view(argv[1]) == "help") {
    words.erase(words.begin() + 1);
    words.push_back("--help");
  }
  return words;
}

int main_of(int argc, char** argv) {
  CommandLine line("subworld", "Distributed haptic simulation: starts, watches and stops the programs of a run.");
  line.footer(kExamples);
  line.version(part_versions);

  RunWords run_words, up_words;
  CommandLine& run_command = line.command("run", "Runs a scene: one world, and a haptic and a device process per user");
  add_run(run_command, run_words);

  RunRequest plan_request;
  CommandLine& plan_command = line.command(
      "plan", "Reads a scene, warns of problems, and lists the optimisations that are on or off, with reasons");
  add_run_options(plan_command, plan_request.options);
  plan_command.flag("--gui", plan_request.gui, "with the display");
  bool settings = false;
  plan_command.flag("--settings", settings, "lists all settings, with value, default, range, meaning and readers");

  ControlRequest control_request;
  CommandLine& control_command =
      line.command("control", "Stops, pauses, resumes or steps a running world, or changes its engine");
  add_control(control_command, control_request);

  CommandLine& up_command = line.command("up", "Runs a session: the programs of one run on several hosts");
  add_up(up_command, up_words);

  CollectRequest collection;
  CommandLine& collect_command =
      line.command("collect", "Makes one summary and verdict of results that programs wrote into several folders");
  add_collect(collect_command, collection);
  add_programs(line);

  become_program(argc, argv);
  const std::vector<const char*> words = words_of(argc, argv);
  if (const auto code = line.parse(static_cast<int>(words.size()), words.data())) return *code;
  run_words.request.command_line = up_words.request.command_line = collection.command_line =
      joined(std::span(argv, static_cast<std::size_t>(argc)), " ");
  if (run_command.chosen()) return run(run_words.complete());
  if (up_command.chosen()) return run(up_words.complete());
  if (collect_command.chosen()) return collect(collection);
  control_command.chosen() ? control(control_request) : print_plan(plan_request, settings);
  return static_cast<int>(ExitCode::done);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace subworld;
  reserve_standard_streams();
  return finished("subworld", guarded("subworld", [&] { return main_of(argc, argv); }));
}
