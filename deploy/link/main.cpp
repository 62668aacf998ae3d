#include "io/options/options.hpp"
#include "io/results/output.hpp"
#include "link/network.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "rt/cyclic.hpp"
#include "rt/stop.hpp"
#include "tools.hpp"

#include <fmt/core.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <map>
#include <thread>

namespace {

using namespace subworld;

constexpr int kMostHosts = 8;

/// What `subworld link` is to do.
struct LinkRequest {
  std::vector<std::string> words;  ///< of both directions
  std::string a_to_b, b_to_a;      ///< take the place of `words` where given
  int hosts = 2;
  std::uint64_t seed = 1;
  std::array<std::string, kMostHosts> commands;  ///< for each host; empty: none
  double duration_s = 0.0;                       ///< 0: until a signal, or until the commands have ended
};

std::string host_name(int number) { return std::string(1, static_cast<char>('a' + number)); }

void nap() { std::this_thread::sleep_for(std::chrono::milliseconds(50)); }

/// The commands in the hosts. The destructor ends them.
class HostCommands {
 public:
  HostCommands(const EmulatedNetwork& network, const LinkRequest& request) {
    for (int i = 0; i < network.hosts(); ++i) {
      if (!request.commands[i].empty()) running_[network.host(i).start(request.commands[i])] = host_name(i);
    }
  }
  ~HostCommands() {
    constexpr double kPatience_s = 3.0;  // from SIGTERM to SIGKILL
    for (const auto& [pid, host] : running_) kill(-pid, SIGTERM);
    for (const TimePoint until = Clock::now() + from_seconds(kPatience_s); !ended() && Clock::now() < until; nap()) {
    }
    for (const auto& [pid, host] : running_) {
      kill(-pid, SIGKILL);
      waitpid(pid, nullptr, 0);
    }
  }
  HostCommands(const HostCommands&) = delete;
  HostCommands& operator=(const HostCommands&) = delete;

  /// Whether all have ended.
  [[nodiscard]] bool ended() {
    std::erase_if(running_, [&](const auto& one) {
      int status = 0;
      if (waitpid(one.first, &status, WNOHANG) != one.first) return false;
      const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
      if (code != 0) failed_.push_back(fmt::format("the command on host {} ended with exit code {}", one.second, code));
      return true;
    });
    return running_.empty();
  }
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

/// Prints each direction that has carried packets.
void print_counters(EmulatedNetwork& network) {
  for (int from = 0; from < network.hosts(); ++from) {
    for (int to = 0; to < network.hosts(); ++to) {
      if (from == to) continue;
      const LinkCounters counters = network.counters({from, to});
      if (counters.packets > 0 || network.hosts() == 2)
        fmt::print("  {} -> {}: {}\n", host_name(from), host_name(to), counters_text(counters));
    }
  }
  std::fflush(stdout);
}

void print_link(const EmulatedNetwork& network) {
  fmt::print("link: {} hosts, forwarded with {}\n", network.hosts(), network.scheduling());
  const std::string ab = to_text(network.link({0, 1})), ba = to_text(network.link({1, 0}));
  fmt::print("  {}\n", ab == ba ? "each direction: " + ab : fmt::format("a -> b: {}; b -> a: {}", ab, ba));
  if (network.hosts() > 2) fmt::print("  other pairs: {}\n", to_text(network.link({0, 2})));
  for (int i = 0; i < network.hosts(); ++i) {
    fmt::print("  host {}: {} on {}; enter it with: nsenter --net={} bash\n", host_name(i), network.address(i),
               EmulatedNetwork::kInterface, network.host(i).path());
  }
  std::fflush(stdout);
}

/// Until the commands have ended, the time is over or a signal arrives. Without commands it prints the counters.
void carry(EmulatedNetwork& network, const LinkRequest& request) {
  const bool with_commands = std::ranges::any_of(request.commands, [](const std::string& one) { return !one.empty(); });
  const TimePoint start = Clock::now();
  int seconds = 0;
  std::vector<std::string> failed;
  {
    HostCommands commands(network, request);
    while (stop_signal() == 0) {
      nap();
      const double since_s = to_seconds(Clock::now() - start);
      if (commands.ended() && with_commands) break;
      if (request.duration_s > 0.0 && since_s >= request.duration_s) break;
      if (with_commands || since_s < seconds + 1) continue;
      seconds = static_cast<int>(since_s);
      fmt::print("t = {} s\n", seconds);
      print_counters(network);
    }
    failed = commands.failed();
  }
  fmt::print("link: carried in {:.1f} s:\n", to_seconds(Clock::now() - start));
  print_counters(network);
  if (!failed.empty()) throw Error(ExitCode::failed, fmt::format("link: {}", joined(failed, "; ")));
}

void add_link_options(CommandLine& line, LinkRequest& request) {
  std::vector<std::string> presets;
  for (const LinkPreset& preset : link_presets())
    presets.push_back(fmt::format("  {:<14} {:<26} {}", preset.name, preset.text, preset.about));
  line.add("link", &request.words, "a preset, options of `tc netem`, or both; one way, for each direction")
      .otherwise("ideal");
  line.add("--a-to-b", &request.a_to_b, "the direction from a to b, in the same words").otherwise("as the link");
  line.add("--b-to-a", &request.b_to_a, "the direction from b to a").otherwise("as the link");
  line.add("--hosts", &request.hosts, "number of hosts, called a, b, c ...; each pair has the link")
      .range(2, kMostHosts);
  for (int i = 0; i < kMostHosts; ++i) {
    Option option =
        line.add("--on-" + host_name(i), &request.commands[i],
                 fmt::format("shell command to run on host {}; the link ends with its commands", host_name(i)))
            .otherwise("none");
    if (i >= 2) option.hidden();
  }
  line.add("--seed", &request.seed, "of the random draws");
  line.add("--duration", &request.duration_s, "length of the run").range(0.0, 1e6, "s").otherwise("until Ctrl-C");
  line.footer(fmt::format(
      "Presets (one way; the round trip has twice the delay):\n{}\n"
      "Options: delay TIME [JITTER]  jitter TIME  distribution uniform|normal|pareto  loss RATIO\n"
      "         loss gemodel P [R [1-H [1-K]]]  duplicate RATIO  reorder RATIO [gap N]  rate RATE  limit PACKETS\n"
      "         outage from TIME for TIME [every TIME]\n"
      "Examples:\n"
      "  subworld link wifi\n"
      "  subworld link delay 20ms 5ms distribution normal loss 2%\n"
      "  subworld link hotel rate 20mbit outage from 5s for 1s every 30s\n"
      "  subworld link --a-to-b 4g --b-to-a 'delay 80ms rate 1mbit'\n"
      "  subworld link wifi --on-a 'iperf3 -s -1' --on-b 'sleep 1; iperf3 -c 10.9.0.1'\n"
      "Needs root, or a user namespace: unshare -rn subworld link ...\n"
      "Exit codes: 0 done, 1 failed, also a command on a host, 2 usage",
      joined(presets, "\n")));
}

int main_of(int argc, char** argv) {
  CommandLine line("subworld link", about_tool("link"));
  LinkRequest request;
  add_link_options(line, request);
  if (const auto code = line.parse(argc, argv)) return *code;
  const LinkSettings all = parse_link(joined(request.words, " "));
  const LinkSettings a_to_b = request.a_to_b.empty() ? all : parse_link(request.a_to_b);
  const LinkSettings b_to_a = request.b_to_a.empty() ? all : parse_link(request.b_to_a);
  for (int i = request.hosts; i < kMostHosts; ++i) {
    if (!request.commands[i].empty())
      throw Error(ExitCode::usage, fmt::format("link: --on-{0}: there is no host {0}; raise --hosts", host_name(i)));
  }
  watch_stop_signals();
  EmulatedNetwork network(request.seed);
  for (int i = 0; i < request.hosts; ++i) network.add_host(host_name(i));
  network.set_links(all);
  network.set_link({0, 1}, a_to_b);
  network.set_link({1, 0}, b_to_a);
  network.start();
  print_link(network);
  carry(network, request);
  return static_cast<int>(ExitCode::done);
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::finished("subworld link", subworld::guarded("subworld link", [&] { return main_of(argc, argv); }));
}
