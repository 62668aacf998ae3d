#include "commands.hpp"

#include "io/ending.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "record/replay.hpp"
#include "watch/programs.hpp"

#include <fmt/core.h>
#include <pwd.h>
#include <unistd.h>

#include <map>
#include <string>
#include <vector>

namespace subworld {
namespace {

/// Of this command, as the verdict of a run names it.
std::string sender_text() {
  const passwd* const user = getpwuid(geteuid());
  return fmt::format("{} on {}, process {}", user == nullptr ? std::to_string(geteuid()) : user->pw_name, host_name(),
                     getpid());
}

/// The domain of the only run of this machine. Throws `Error` (usage) where there is none, or more than one.
int only_domain() {
  const std::vector<ClaimedDomain> claimed = claimed_domains();
  if (claimed.size() == 1) return claimed.front().domain;
  std::vector<int> domains;
  for (const ClaimedDomain& one : claimed) domains.push_back(one.domain);
  throw Error(ExitCode::usage,
              claimed.empty()
                  ? "no run of this machine is alive; name the domain of another one with --domain"
                  : fmt::format("runs on the domains {} are alive; name one with --domain", joined(domains, ", ")));
}

/// What a run on one host and one on several have in common.
void add_common(CommandLine& line, RunWords& words) {
  RunRequest& request = words.request;
  add_record_option(line, request.options);
  add_trace_option(line, request.options);
  line.add("--placement", &words.placement,
           "real time: auto gives the world a core of its own where the others have room for the haptic loops; none "
           "leaves it to the OS, which is better where several runs share the machine")
      .one_of({"auto", "none"})
      .environment("SUBWORLD_PLACEMENT");
  line.add(
          "--restart", &words.restart,
          "real time: starts a program again that ends before the run: on-failure where it was killed, is halted for a "
          "second or fails; always also where it was asked to end")
      .one_of({"never", "on-failure", "always"});
  line.flag("--explain", request.explain,
            "also explain the result in plain words, with what to look at and to try next");
  line.flag("--strict", request.strict, "exit code 4 where a quality gate is missed, also by the OS");
}

}  // namespace

RunRequest RunWords::complete() const {
  RunRequest complete = request;
  complete.place = placement == "auto";
  if (restart != "never") complete.restart = restart == "always" ? Restart::always : Restart::on_failure;
  if (!complete.session.empty()) return complete;
  complete.page |= imply_browser(complete.options);
  if (complete.page && !complete.options.live.port) complete.options.live.port = 0;
  complete.gui |= complete.options.live.port.has_value();
  check_live_options(complete.options.live);
  return complete;
}

void add_run(CommandLine& line, RunWords& words) {
  RunRequest& request = words.request;
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
  line.add("--ros2", &request.ros_domain,
           "also show the run to ROS 2 on its domain, as `subworld ros2` does; usually 0")
      .range(0, 232)
      .otherwise("no");
  add_device_options(line, request.options);
  add_bodies_options(line, request.options);
  add_checkpoint_options(line, request.options);
  add_common(line, words);
}

void add_up(CommandLine& line, RunWords& words) {
  RunRequest& request = words.request;
  request.dds.clear();
  line.add("session", &request.session, "session file (YAML), or the name of a session of Subworld").required();
  line.add("--host", &request.host, "start only the programs of this host, here").otherwise("all");
  line.flag("--namespaces", request.namespaces,
            "make each host a network namespace of this machine; needs the rights of root");
  line.add("--link", &request.link, "with --namespaces: the link between any two hosts, as for `subworld link`")
      .otherwise("the session's");
  line.add("--seed", &request.seed, "with --namespaces: of the link's random draws");
  line.add("--dds", &request.dds, "DDS vendor; mixed alternates over the programs")
      .one_of({"fastdds", "cyclonedds", "mixed"})
      .otherwise("the session's");
  line.add("--ssh", &request.ssh, "program that starts commands on the hosts which have `ssh`");
  add_out(line, request.options, "folder for the results").otherwise("a new out/SESSION-TIME");
  add_common(line, words);
  line.footer(
      "Examples:\n"
      "  subworld up three_hosts --namespaces\n"
      "  subworld up three_hosts --namespaces --record run.mcap\n"
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

void add_control(CommandLine& line, ControlRequest& request) {
  std::vector<std::string> verbs;
  for (const VerbName& verb : kVerbs) verbs.emplace_back(verb.name);
  line.add("verb", &request.verb, "the order").one_of(verbs).required();
  line.add("engine", &request.engine.engine, "for the order engine: the engine to change to");
  line.add("--preset", &request.engine.preset, "preset of that engine");
  line.add("--user", &request.user, "for the order leave: the user's number")
      .range(0, static_cast<int>(kMostUsers) - 1);
  line.add("--time", &request.time_s, "for the order seek, which a replay executes: the moment to move to")
      .range(0.0, 1e6, "s");
  line.add("--speed", &request.speed, "for the order speed, which a replay executes: simulated time per time")
      .range(kLeastReplaySpeed, kMostReplaySpeed);
  line.add("--ratio", &request.ratio, "for the order ratio: bounds within those that the run was started with")
      .check([](const std::string& text) {
        return setting_fault({"ratio", text});
      });
  line.flag("--haptic", request.haptic, "change the sub-worlds' engine instead of the world's");
  request.network.domain = -1;
  add_domain(line, request.network.domain).otherwise("that of the only run of this machine");
  add_dds(line, request.network.dds, {"fastdds", "cyclonedds"});
  add_network(line, request.network);
  line.add("--wait", &request.wait_s, "longest wait for the world, and then for its answer").range(0.1, 3600.0, "s");
  line.footer(
      "Examples:\n"
      "  subworld control pause\n"
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
  if (request.haptic) request.engine.target = EngineOrder::Target::haptic;
  const auto text = [](const auto& value) { return value ? fmt::format("{}", *value) : std::string(); };
  const std::map<ControlVerb, std::string> arguments{
      {ControlVerb::set_engine, request.engine.engine.empty() ? "" : to_text(request.engine)},
      {ControlVerb::leave, text(request.user)},
      {ControlVerb::seek, text(request.time_s)},
      {ControlVerb::set_speed, text(request.speed)},
      {ControlVerb::set_ratio, request.ratio}};
  Control order;
  for (const VerbName& verb : kVerbs) {
    const auto argument = arguments.find(verb.verb);
    const bool wanted = request.verb == verb.name, given = argument != arguments.end() && !argument->second.empty();
    if (argument != arguments.end() && wanted != given) {
      throw Error(ExitCode::usage,
                  fmt::format("subworld control {0} {1}: the order {0} needs its argument, and no other "
                              "order takes it",
                              verb.name, verb.example));
    }
    if (wanted) order = {.verb = verb.verb, .argument = given ? argument->second : ""};
  }
  if (order.verb == ControlVerb::stop) order.argument = sender_text();
  if (request.network.domain < 0) request.network.domain = only_domain();
  send_control(request.network, order, request.wait_s);
}

}  // namespace subworld
