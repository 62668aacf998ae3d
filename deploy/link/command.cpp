#include "link/command.hpp"

#include "link/network.hpp"
#include "link/validate.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "rt/cyclic.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <map>
#include <thread>

namespace subworld {

namespace {

constexpr double kPoll_s = 0.05;
constexpr double kPatience_s = 3.0;  // from SIGTERM to SIGKILL for a command

std::string host_name(int number) { return std::string(1, static_cast<char>('a' + number)); }

LinkBackend backend_of(const std::string& name) {
  if (name == "netem") return LinkBackend::netem;
  return name == "tun" ? LinkBackend::tun : LinkBackend::automatic;
}

void nap() { std::this_thread::sleep_for(from_seconds(kPoll_s)); }

/// The commands in the hosts. The destructor ends them.
class HostCommands {
 public:
  HostCommands(const EmulatedNetwork& network, const LinkRequest& request) {
    for (int i = 0; i < network.hosts(); ++i) {
      if (!request.commands[i].empty()) running_[network.host(i).start(request.commands[i])] = host_name(i);
    }
  }
  ~HostCommands() {
    for (const auto& [pid, host] : running_) kill(-pid, SIGTERM);
    const TimePoint until = Clock::now() + from_seconds(kPatience_s);
    while (!running_.empty() && Clock::now() < until) {
      collect();
      if (!running_.empty()) nap();
    }
    for (const auto& [pid, host] : running_) {
      kill(-pid, SIGKILL);
      waitpid(pid, nullptr, 0);
    }
  }
  HostCommands(const HostCommands&) = delete;
  HostCommands& operator=(const HostCommands&) = delete;

  /// Notes the commands that have ended.
  void collect() {
    std::erase_if(running_, [&](const auto& one) {
      int status = 0;
      if (waitpid(one.first, &status, WNOHANG) != one.first) return false;
      const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
      if (code != 0) failed_.push_back(fmt::format("the command on host {} ended with exit code {}", one.second, code));
      return true;
    });
  }
  [[nodiscard]] bool ended() const { return running_.empty(); }
  [[nodiscard]] const std::vector<std::string>& failed() const { return failed_; }

 private:
  std::map<pid_t, std::string> running_;
  std::vector<std::string> failed_;
};

std::string counters_text(const LinkCounters& counters) {
  std::string text = fmt::format("{} packets, {} lost", counters.packets, counters.lost);
  if (counters.in_outage > 0) text += fmt::format(", {} in outage", counters.in_outage);
  if (counters.queue_full > 0) text += fmt::format(", {} queue full", counters.queue_full);
  if (counters.duplicated > 0) text += fmt::format(", {} duplicated", counters.duplicated);
  if (counters.delay.count() > 0) {
    text += fmt::format(", delay p50 {:.2f} p99 {:.2f} ms, late p99 {:.3f} ms", 1e3 * counters.delay.quantile_s(0.5),
                        1e3 * counters.delay.quantile_s(0.99), 1e3 * counters.lateness.quantile_s(0.99));
  }
  return text;
}

/// Each direction that has carried packets.
std::string all_counters(EmulatedNetwork& network) {
  std::string text;
  for (int from = 0; from < network.hosts(); ++from) {
    for (int to = 0; to < network.hosts(); ++to) {
      if (from == to) continue;
      const LinkCounters counters = network.counters({from, to});
      if (counters.packets > 0 || network.hosts() == 2)
        text += fmt::format("  {} -> {}: {}\n", host_name(from), host_name(to), counters_text(counters));
    }
  }
  return text;
}

void print_link(const EmulatedNetwork& network) {
  fmt::print("link: {} hosts, back end {}\n", network.hosts(), network.description());
  const std::string ab = to_text(network.link({0, 1})), ba = to_text(network.link({1, 0}));
  fmt::print("  {}\n", ab == ba ? "each direction: " + ab : fmt::format("a -> b: {}; b -> a: {}", ab, ba));
  if (network.hosts() > 2) fmt::print("  other pairs: {}\n", to_text(network.link({0, 2})));
  for (int i = 0; i < network.hosts(); ++i) {
    fmt::print("  host {}: {} on {}; enter it with: nsenter --net={} bash\n", host_name(i), network.address(i),
               EmulatedNetwork::kInterface, network.host(i).path());
  }
  std::fflush(stdout);
}

int validated(EmulatedNetwork& network, double duration_s) {
  const double ab_hz = probe_rate_hz(network.link({0, 1})), ba_hz = probe_rate_hz(network.link({1, 0}));
  fmt::print("  validation: {:.4g} probes a second from a to b, {:.4g} from b to a, for {} s\n", ab_hz, ba_hz,
             duration_s);
  std::fflush(stdout);
  const std::vector<LinkValidation> found = validate(network, duration_s);
  if (stop_signal() != 0) {
    fmt::print("validation: stopped by a signal\n");
    return static_cast<int>(ExitCode::done);
  }
  bool ok = true;
  for (const LinkValidation& one : found) {
    fmt::print("{} -> {}: {}\n{}", host_name(one.ends.from), host_name(one.ends.to), to_text(network.link(one.ends)),
               table_of(one.checks));
    ok = ok && one.ok();
  }
  fmt::print("{}verdict: {}\n", all_counters(network),
             ok ? "ok" : "missed; on a busy machine, end other programs and try again");
  return static_cast<int>(ok ? ExitCode::done : ExitCode::quality);
}

/// Until the commands have ended, the time is over or a signal arrives. Without commands it prints the counters.
int carry(EmulatedNetwork& network, const LinkRequest& request) {
  const bool with_commands = std::ranges::any_of(request.commands, [](const std::string& one) { return !one.empty(); });
  const TimePoint start = Clock::now();
  int seconds = 0;
  std::vector<std::string> failed;
  {
    HostCommands commands(network, request);
    while (stop_signal() == 0) {
      nap();
      commands.collect();
      const double since_s = to_seconds(Clock::now() - start);
      if (with_commands && commands.ended()) break;
      if (request.duration_s > 0.0 && since_s >= request.duration_s) break;
      if (with_commands || since_s < seconds + 1) continue;
      seconds = static_cast<int>(since_s);
      fmt::print("t = {} s\n{}", seconds, all_counters(network));
      std::fflush(stdout);
    }
    failed = commands.failed();
  }
  fmt::print("link: carried in {:.1f} s:\n{}", to_seconds(Clock::now() - start), all_counters(network));
  if (!failed.empty()) throw Error(ExitCode::failed, fmt::format("link: {}", joined(failed, "; ")));
  return static_cast<int>(ExitCode::done);
}

/// The settings of all directions, before anything is made.
struct Directions {
  LinkSettings all, a_to_b, b_to_a;
};
Directions directions_of(const LinkRequest& request) {
  Directions found;
  found.all = parse_link(joined(request.words, " "));
  found.a_to_b = request.a_to_b.empty() ? found.all : parse_link(request.a_to_b);
  found.b_to_a = request.b_to_a.empty() ? found.all : parse_link(request.b_to_a);
  if (request.validate_s <= 0.0) return found;
  for (const LinkSettings* one : {&found.a_to_b, &found.b_to_a}) {
    if (one->outage.for_s > 0.0)
      throw Error(ExitCode::usage, "link: --validate measures no outage; validate the link without it");
  }
  return found;
}

}  // namespace

void add_link_options(CommandLine& line, LinkRequest& request) {
  std::vector<std::string> presets;
  for (const LinkPreset& preset : link_presets())
    presets.push_back(fmt::format("  {:<14} {:<26} {}", preset.name, preset.text, preset.about));
  line.add("link", &request.words, "a preset, options of `tc netem`, or both; one way, for each direction")
      .otherwise("ideal");
  line.add("--a-to-b", &request.a_to_b, "the direction from a to b, in the same words").otherwise("as the link");
  line.add("--b-to-a", &request.b_to_a, "the direction from b to a").otherwise("as the link");
  line.add("--hosts", &request.hosts, "number of hosts, called a, b, c ...; each pair has the link")
      .range(2, LinkRequest::kMostHosts);
  for (int i = 0; i < LinkRequest::kMostHosts; ++i) {
    Option option =
        line.add("--on-" + host_name(i), &request.commands[i],
                 i < 2 ? fmt::format("shell command to run on host {}; the link ends with its commands", host_name(i))
                       : "likewise")
            .otherwise("none");
    if (i >= 2) option.hidden();
  }
  line.add("--backend", &request.backend,
           "netem of the kernel, or the forwarder of this program; auto: netem where it can")
      .one_of({"auto", "netem", "tun"});
  line.add("--seed", &request.seed, "of the random draws; netem has its own");
  line.add("--mtu", &request.mtu, "largest IP packet, bytes").range(576, 9000);
  line.add("--duration", &request.duration_s, "length of the run").range(0.0, 1e6, "s").otherwise("until Ctrl-C");
  line.add("--validate", &request.validate_s, "send probes over the link for this long, and compare with the request")
      .range(1.0, 3600.0, "s")
      .implies("5")
      .otherwise("off");
  line.footer(fmt::format(
      "Presets (one way; the round trip has twice the delay):\n{}\n"
      "Options: delay TIME [JITTER]  jitter TIME  distribution uniform|normal|pareto  loss RATIO\n"
      "         loss gemodel P [R [1-H [1-K]]]  duplicate RATIO  reorder RATIO [gap N]  rate RATE  limit PACKETS\n"
      "         outage from TIME for TIME [every TIME]\n"
      "Examples:\n"
      "  subworld link wifi --validate\n"
      "  subworld link delay 20ms 5ms distribution normal loss 2%\n"
      "  subworld link hotel rate 20mbit outage from 5s for 1s every 30s\n"
      "  subworld link --a-to-b 4g --b-to-a 'delay 80ms rate 1mbit'\n"
      "  subworld link wifi --on-a 'iperf3 -s -1' --on-b 'sleep 1; iperf3 -c 10.9.0.1'\n"
      "Needs root, or a user namespace: unshare -rn subworld link ...\n"
      "Exit codes: 0 done, 1 failed, also a command on a host, 2 usage, 4 a measured value is not as requested",
      joined(presets, "\n")));
}

int run_link(const LinkRequest& request) {
  const Directions directions = directions_of(request);
  for (int i = request.hosts; i < LinkRequest::kMostHosts; ++i) {
    if (!request.commands[i].empty())
      throw Error(ExitCode::usage, fmt::format("link: --on-{0}: there is no host {0}; raise --hosts", host_name(i)));
  }
  watch_stop_signals();
  EmulatedNetwork network({.backend = backend_of(request.backend), .mtu = request.mtu, .seed = request.seed});
  for (int i = 0; i < request.hosts; ++i) network.add_host(host_name(i));
  network.set_links(directions.all);
  network.set_link({0, 1}, directions.a_to_b);
  network.set_link({1, 0}, directions.b_to_a);
  network.start();
  print_link(network);
  return request.validate_s > 0.0 ? validated(network, request.validate_s) : carry(network, request);
}

}  // namespace subworld
