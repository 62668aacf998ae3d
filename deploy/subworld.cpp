#include "io/command_line.hpp"
#include "launch.hpp"
#include "model/error.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include <string_view>

namespace {

using namespace subworld;

/// Throws `Error` (usage) where the first word is meant as a command and is none: CLI11 would not name it.
void check_command(const CLI::App& app, int argc, const char* const* argv) {
  if (argc < 2 || *argv[1] == '-') return;
  std::string known;
  for (const CLI::App* command : app.get_subcommands(nullptr)) {
    if (command->get_name() == argv[1]) return;
    known += fmt::format("{}{}", known.empty() ? "" : ", ", command->get_name());
  }
  throw Error(ExitCode::usage, fmt::format("\"{}\" is no command; choose one of: {}", argv[1], known));
}

int main_of(int argc, char** argv) {
  CLI::App app{"Distributed haptic simulation: starts, watches and stops the programs of a run.", "subworld"};
  app.require_subcommand(1);
  app.footer(
      "Examples:\n"
      "  subworld run deploy/scenes/heap.yaml --mode realtime --duration 20 --gui\n"
      "  subworld run deploy/scenes/heap.yaml --mode lockstep --duration 5 --dds mixed\n"
      "  subworld run deploy/scenes/heap.yaml --users 2\n"
      "  subworld run row --bodies 'cube*,hand/proxy' --bodies-rate 50\n"
      "  subworld control pause --domain 100\n"
      "  subworld control engine havok --haptic --domain 100\n"
      "  subworld plan deploy/scenes/row.yaml\n"
      "  subworld lab coupling --quick\n"
      "  subworld lab engines --quick\n"
      "  subworld lab stability --quick\n"
      "  subworld lab plan --quick\n"
      "Exit codes: 0 done (also SIGINT, SIGTERM), 1 failed while running, 2 usage or scene, 3 middleware,\n"
      "            4 a quality gate was missed (--strict).");

  RunRequest request;
  CLI::App* run_command =
      app.add_subcommand("run", "Runs a scene: one world, and a haptic and a device process per user");
  add_run_options(*run_command, request.options);
  add_trace_option(*run_command, request.options);
  add_bodies_options(*run_command, request.options);
  run_command->add_option("--dds", request.dds, "DDS vendor; mixed: the programs alternate")
      ->check(CLI::IsMember({"fastdds", "cyclonedds", "mixed"}))
      ->envname("SUBWORLD_DDS");
  run_command->add_option("--domain", request.domain, "DDS domain id (default: the first that no other run holds)")
      ->check(CLI::Range(0, 232))
      ->envname("SUBWORLD_DOMAIN");
  run_command->add_flag("--gui", request.gui, "also start the display, which writes a picture");
  std::string placement = "auto";
  run_command
      ->add_option(
          "--placement", placement,
          "real time: auto gives the world a core of its own where the others have room for the haptic loops; none "
          "leaves it to the system, which is better where several runs share the machine")
      ->check(CLI::IsMember({"auto", "none"}))
      ->envname("SUBWORLD_PLACEMENT")
      ->capture_default_str();
  run_command->add_flag("--strict", request.strict, "end with 4 when a quality gate is missed");

  RunRequest plan_request;
  CLI::App* plan_command =
      app.add_subcommand("plan", "Prints what a scene needs and what is left out, with the reasons");
  add_run_options(*plan_command, plan_request.options);
  plan_command->add_flag("--gui", plan_request.gui, "with the display");

  Network control_network;
  std::string control_verb;
  double control_wait_s = 5.0;
  CLI::App* control_command =
      app.add_subcommand("control", "Tells a running world to stop, pause, resume, make one step or change its engine");
  control_command->add_option("verb", control_verb, "what to do")
      ->required()
      ->check(CLI::IsMember({"stop", "pause", "resume", "step", "engine"}));
  EngineOrder control_engine;
  bool control_haptic = false;
  control_command->add_option("engine", control_engine.engine, "with the verb engine: the one to change to");
  control_command->add_option("--preset", control_engine.preset, "of that engine")->capture_default_str();
  control_command->add_flag("--haptic", control_haptic, "change the sub-worlds' engine, not the world's");
  control_command->add_option("--domain", control_network.domain, "DDS domain id of the run")
      ->required()
      ->check(CLI::Range(0, 232))
      ->envname("SUBWORLD_DOMAIN");
  control_command->add_option("--dds", control_network.dds, "DDS vendor")
      ->check(CLI::IsMember({"fastdds", "cyclonedds"}))
      ->envname("SUBWORLD_DDS");
  control_command->add_option("--peers", control_network.peers, "the world's host")->delimiter(',');
  control_command->add_option("--interface", control_network.interface_address, "address of the network interface");
  control_command->add_option("--wait", control_wait_s, "how long to look for the world, and then for its answer, s")
      ->check(CLI::Range(0.1, 3600.0));

  CLI::App* lab_command = app.add_subcommand("lab", "Evaluations: runs a sweep and writes tables and a report");
  lab_command->require_subcommand(1);
  lab_command->footer(
      "Examples:\n"
      "  subworld lab coupling --quick --out out/quick\n"
      "  subworld lab coupling row --ratio 1,4,10,20 --out out/row\n"
      "  subworld lab engines --quick --out out/engines\n"
      "  subworld lab stability --quick --out out/stability\n"
      "  subworld lab plan --quick --out out/plan\n"
      "  subworld lab coupling --help");
  lab_command->add_subcommand("coupling", "The error of the felt force against the run time of each coupling scheme")
      ->prefix_command()
      ->set_help_flag();
  lab_command->add_subcommand("engines", "What a step of each physics engine costs, and whether structures stand")
      ->prefix_command()
      ->set_help_flag();
  lab_command->add_subcommand("stability", "How far each engine is from formulas and limits of mechanics, with margins")
      ->prefix_command()
      ->set_help_flag();

  lab_command->add_subcommand("plan", "What it saves to leave out what a scene does not need, and what it changes")
      ->prefix_command()
      ->set_help_flag();

  check_command(app, argc, argv);
  if (argc > 2 && std::string_view(argv[1]) == "lab") {
    check_command(*lab_command, argc - 1, argv + 1);
    if (*argv[2] != '-') become_lab(argv[2], argv + 2);
  }
  if (const auto code = parse_arguments(app, argc, argv)) return *code;
  request.command_line = fmt::format("{}", fmt::join(argv, argv + argc, " "));
  request.place = placement == "auto";
  if (*run_command) return run(request);
  if (*control_command) {
    if ((control_verb == "engine") == control_engine.engine.empty()) {
      throw Error(ExitCode::usage,
                  control_verb == "engine"
                      ? "control engine needs a name, for example: subworld control engine bullet_float"
                      : fmt::format("control {} takes no \"{}\"", control_verb, control_engine.engine));
    }
    if (control_haptic) control_engine.target = EngineOrder::Target::haptic;
    send_control(control_network, control_verb, control_engine, control_wait_s);
    return static_cast<int>(ExitCode::done);
  }
  print_plan(plan_request);
  return static_cast<int>(ExitCode::done);
}

}  // namespace

int main(int argc, char** argv) {
  return guarded("subworld", [&] { return main_of(argc, argv); });
}
