#include "lab/network/measure.hpp"

#include "model/error.hpp"
#include "rt/cyclic.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>
#include <sys/mman.h>
#include <sys/wait.h>

#include <algorithm>
#include <csignal>
#include <memory>
#include <new>
#include <optional>
#include <thread>
#include <vector>

namespace subworld {

namespace {

constexpr double kMatch_s = 20.0;  // patience
constexpr double kEnd_s = 5.0;
constexpr double kLeastRest_s = 0.5;
constexpr double kUsualMatch_s = 0.2;

/// How long messages may arrive after the last one was sent: queues empty and lost ones are repeated.
double rest_s(const NetworkCell& cell) {
  const LinkSettings link = parse_link(cell.link);
  return kLeastRest_s + (cell.reliable ? 10.0 : 4.0) * (link.delay_s + 2.0 * link.jitter_s);
}

class SharedMemory {
 public:
  SharedMemory() {
    void* const memory = mmap(nullptr, sizeof(CellShared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) throw Error(ExitCode::failed, "lab network: no shared memory");
    shared_ = new (memory) CellShared;
  }
  ~SharedMemory() { munmap(shared_, sizeof(CellShared)); }
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;
  CellShared& operator*() const { return *shared_; }
  CellShared* operator->() const { return shared_; }

 private:
  CellShared* shared_;
};

/// The processes of a cell. The destructor ends them.
class Peers {
 public:
  explicit Peers(CellShared& shared) : shared_(shared) {}
  ~Peers() {
    shared_.phase = CellPhase::ending;
    const TimePoint until = Clock::now() + from_seconds(kEnd_s);
    while (!all_ended() && Clock::now() < until) nap();
    for (const pid_t pid : running_) {
      if (pid <= 0) continue;
      kill(pid, SIGKILL);
      waitpid(pid, nullptr, 0);
    }
  }
  Peers(const Peers&) = delete;
  Peers& operator=(const Peers&) = delete;

  void start(const PeerPlan& plan) { running_.push_back(start_peer(plan, static_cast<int>(running_.size()), shared_)); }

  static void nap() { std::this_thread::sleep_for(std::chrono::milliseconds(2)); }

  [[nodiscard]] bool all_ended() {
    for (pid_t& pid : running_) {
      if (pid > 0 && waitpid(pid, nullptr, WNOHANG) == pid) pid = 0;
    }
    return std::ranges::all_of(running_, [](pid_t pid) { return pid == 0; });
  }
  /// Why one of them cannot go on; empty: all run, or have done their work.
  [[nodiscard]] std::string failure() {
    (void)all_ended();
    for (std::size_t i = 0; i < running_.size(); ++i) {
      const PeerShared& peer = shared_.peers[i];
      if (peer.failure[0] != 0) return peer.failure.data();
      if (running_[i] == 0 && !peer.reported) return fmt::format("the process of {} ended too early", name_of_peer(i));
    }
    return {};
  }
  /// Waits for a condition of all processes. The failure in words where a process ends or the time is over.
  template <class Reached>
  [[nodiscard]] std::string await(Reached reached, double patience_s, const char* what) {
    const TimePoint until = Clock::now() + from_seconds(patience_s);
    while (stop_signal() == 0) {
      if (std::string text = failure(); !text.empty()) return text;
      if (reached()) return {};
      if (Clock::now() > until) return fmt::format("{} within {:g} s", what, patience_s);
      nap();
    }
    return "stopped";
  }
  [[nodiscard]] bool all(std::atomic<bool> PeerShared::*flag) const {
    for (std::size_t i = 0; i < running_.size(); ++i) {
      if (!(shared_.peers[i].*flag)) return false;
    }
    return true;
  }

 private:
  static std::string name_of_peer(std::size_t i) { return i == 0 ? "the world" : fmt::format("user {}", i - 1); }
  CellShared& shared_;
  std::vector<pid_t> running_;
};

/// Sums of the link in both directions between the world and the users.
struct LinkSums {
  std::uint64_t packets = 0, lost = 0, delayed = 0;
  double delays_s = 0.0, cpu_s = 0.0;
};

LinkSums sums_of(EmulatedNetwork* network) {
  LinkSums sums;
  if (network == nullptr) return sums;
  for (int user = 1; user < network->hosts(); ++user) {
    for (const LinkEnds ends : {LinkEnds{0, user}, LinkEnds{user, 0}}) {
      const LinkCounters counters = network->counters(ends);
      sums.packets += counters.packets;
      sums.lost += counters.lost + counters.in_outage + counters.queue_full;
      sums.delayed += counters.delay.count();
      sums.delays_s += counters.delay.sum_s();
    }
  }
  sums.cpu_s = network->cpu_s();
  return sums;
}

void note_link(CellFindings& found, const LinkSums& before, const LinkSums& after, double passed_s) {
  const auto ratio = [](double a, double b) { return b > 0.0 ? a / b : 0.0; };
  found.link_packets = after.packets - before.packets;
  found.link_loss_ratio = ratio(static_cast<double>(after.lost - before.lost), static_cast<double>(found.link_packets));
  found.link_delay_s = ratio(after.delays_s - before.delays_s, static_cast<double>(after.delayed - before.delayed));
  found.link_cpu_ratio = ratio(after.cpu_s - before.cpu_s, passed_s);
}

void note_peers(CellFindings& found, const PeerPlan& plan, const CellShared& shared) {
  const auto users = static_cast<std::uint64_t>(plan.cell.users);
  const std::uint64_t sent = shared.sent;
  found.planned = users * (plan.most() - plan.first());
  found.sent = users * (sent > plan.first() ? sent - plan.first() : 0);
  for (std::uint64_t user = 0; user < users; ++user) {
    const ChannelShared& channel = shared.channels[user];
    found.there.add(channel.there);
    found.round_trip.add(channel.round_trip);
    found.back.add(channel.back);
    found.refused += channel.refused;
  }
  for (std::uint64_t i = 0; i <= users; ++i) {
    const PeerShared& peer = shared.peers[i];
    found.deadline_missed += peer.events[static_cast<std::size_t>(wire::Event::deadline_missed)];
    found.liveliness_lost += peer.events[static_cast<std::size_t>(wire::Event::liveliness_lost)];
    const double share = peer.measured_s > 0.0 ? peer.cpu_s / peer.measured_s : 0.0;
    if (i == 0)
      found.world_cpu_ratio = share;
    else
      found.haptic_cpu_ratio += share / static_cast<double>(users);
  }
  found.scheduling = shared.peers[1].scheduling.data();
}

PeerPlan plan_of(const NetworkCell& cell, const NetworkRunSettings& settings, const EmulatedNetwork* network, int i) {
  PeerPlan plan{.cell = cell, .duration_s = settings.duration_s, .domain = settings.domain};
  if (network == nullptr) return plan;
  plan.host = &network->host(i);
  plan.interface_address = network->address(i);
  if (i > 0) {
    plan.peers.push_back(network->address(0));
  } else {
    for (int user = 1; user <= cell.users; ++user) plan.peers.push_back(network->address(user));
  }
  return plan;
}

/// Throws `Error` (failed) where its processes or its network cannot be made.
CellFindings run_cell(const NetworkCell& cell, const NetworkRunSettings& settings) {
  CellFindings found;
  const std::unique_ptr<EmulatedNetwork> network = network_of(cell, settings.seed);
  const SharedMemory shared;
  const PeerPlan plan = plan_of(cell, settings, network.get(), 0);
  {
    Peers peers(*shared);
    for (int i = 0; i <= cell.users; ++i) peers.start(plan_of(cell, settings, network.get(), i));
    found.failure = peers.await([&] { return peers.all(&PeerShared::matched); }, kMatch_s, "no match of all endpoints");
    if (!found.failure.empty()) return found;
    shared->phase = CellPhase::starting;
    const auto reached = [&](CellPhase phase) { return [&shared, phase] { return shared->phase >= phase; }; };
    constexpr double kMore_s = 10.0;
    found.failure = peers.await(reached(CellPhase::measuring), kStartUp_s + kMore_s, "no measurement begins");
    if (!found.failure.empty()) return found;
    const LinkSums before = sums_of(network.get());
    const TimePoint begin = Clock::now();
    found.failure =
        peers.await(reached(CellPhase::draining), settings.duration_s + kMore_s, "the messages could not be sent");
    if (!found.failure.empty()) return found;
    const TimePoint sent = Clock::now();
    note_link(found, before, sums_of(network.get()), to_seconds(sent - begin));
    while (stop_signal() == 0 && Clock::now() < sent + from_seconds(rest_s(cell))) Peers::nap();
    shared->phase = CellPhase::ending;
    found.failure = peers.await([&] { return peers.all(&PeerShared::reported); }, kEnd_s, "no report of all processes");
  }
  if (found.failure.empty()) note_peers(found, plan, *shared);
  return found;
}

}  // namespace

std::unique_ptr<EmulatedNetwork> network_of(const NetworkCell& cell, std::uint64_t seed) {
  if (cell.transport != NetworkTransport::udp) return nullptr;
  auto network = std::make_unique<EmulatedNetwork>(seed);
  network->add_host("world");
  for (int user = 0; user < cell.users; ++user) network->add_host(fmt::format("user{}", user));
  network->set_links(parse_link(cell.link));
  network->start();
  return network;
}

CellFindings measure_cell(const NetworkCell& cell, const NetworkRunSettings& settings) {
  try {
    return run_cell(cell, settings);
  } catch (const std::exception& e) {
    return {.failure = e.what()};
  }
}

double planned_s(const NetworkCell& cell, const NetworkRunSettings& settings) {
  return kUsualMatch_s + kStartUp_s + settings.duration_s + rest_s(cell);
}

}  // namespace subworld
