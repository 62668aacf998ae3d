#include "watch/top.hpp"

#include "model/error.hpp"
#include "rt/stop.hpp"
#include "wire/bus.hpp"
#include "wire/session.hpp"

#include <fmt/core.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <memory>
#include <set>
#include <thread>

namespace subworld {

namespace {

using TopClock = std::chrono::steady_clock;
constexpr auto kRefresh = std::chrono::milliseconds(1000);
/// A program publishes its status once a second: the newest one of each arrives in this time.
constexpr auto kFirstLook = std::chrono::milliseconds(1500), kFirstSecureLook = std::chrono::milliseconds(4000);
constexpr const char* kUnknown = "-";

/// A domain that is joined for its statuses.
class Listener {
 public:
  Listener(const TopRequest& request, int domain, const std::vector<RunningProgram>& programs) {
    view_.domain = domain;
    Network network = request.network;
    // As the programs do, where the command line says nothing.
    const auto model = std::ranges::find(programs, domain, &RunningProgram::domain);
    if (model != programs.end() && network.interface_address.empty() && network.peers.empty()) {
      network.interface_address = model->network.interface_address;
      network.peers = model->network.peers;
    }
    network.domain = domain;
    Settings listening;
    listening.mode = Mode::realtime;
    try {
      bus_ = open_bus(network, listening, 0.001, "subworld top");
      reader_ = std::make_unique<Reader<Status>>(bus_->reader<Status>());
    } catch (const Error& wrong) {
      if (request.domain) throw;
      view_.fault = wrong.what();
    }
  }

  /// Takes what has arrived, and forgets programs that have not published for four seconds.
  void listen() {
    Status status;
    const auto now = TopClock::now();
    while (reader_ && reader_->take(status) == Take::sample) heard_[{status.program, status.instance}] = {status, now};
    constexpr auto kForget = std::chrono::seconds(4);
    std::erase_if(heard_, [&](const auto& one) { return now - one.second.second > kForget; });
    view_.statuses.clear();
    for (const auto& [who, last] : heard_) view_.statuses.push_back(last.first);
  }

  DomainView& view() { return view_; }

 private:
  DomainView view_;
  std::unique_ptr<Bus> bus_;
  std::unique_ptr<Reader<Status>> reader_;
  std::map<std::pair<ProgramKind, std::uint32_t>, std::pair<Status, TopClock::time_point>> heard_;
};

/// The domains that are shown, joined as they appear.
class Domains {
 public:
  explicit Domains(const TopRequest& request) : request_(request) {}

  void look() {
    const std::vector<RunningProgram> programs = running_programs();
    const std::vector<ClaimedDomain> claimed = claimed_domains();
    std::set<int> used;
    for (const RunningProgram& one : programs) used.insert(one.domain);
    for (const ClaimedDomain& one : claimed) used.insert(one.domain);
    if (request_.domain) used = {*request_.domain};
    std::erase_if(listeners_, [&](const auto& one) { return !used.contains(one.first); });
    for (const int domain : used) {
      auto& listener = listeners_[domain];
      if (!listener) listener = std::make_unique<Listener>(request_, domain, programs);
      DomainView& view = listener->view();
      view.programs = programs;
      std::erase_if(view.programs, [&](const RunningProgram& one) { return one.domain != domain; });
      const auto launcher = std::ranges::find(claimed, domain, &ClaimedDomain::domain);
      view.launcher = launcher == claimed.end() ? std::nullopt : std::optional(launcher->pid);
    }
  }

  std::string text() {
    std::string text;
    for (auto& [domain, listener] : listeners_) {
      listener->listen();
      text += (text.empty() ? "" : "\n") + table_of(listener->view());
    }
    return text.empty() ? "no domain is in use on this machine; another host's: subworld top --domain N --interface I "
                          "--peers HOST\n"
                        : text;
  }

 private:
  const TopRequest& request_;
  std::map<int, std::unique_ptr<Listener>> listeners_;
};

/// Makes single keys readable, and restores the terminal.
class Keys {
 public:
  Keys() : active_(tcgetattr(STDIN_FILENO, &before_) == 0) {
    if (!active_) return;
    termios raw = before_;
    raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
    tcsetattr(STDIN_FILENO, TCSANOW, &raw);
  }
  ~Keys() {
    if (active_) tcsetattr(STDIN_FILENO, TCSANOW, &before_);
  }
  Keys(const Keys&) = delete;
  Keys& operator=(const Keys&) = delete;

  /// Waits for a key that ends the display; false after the timeout.
  [[nodiscard]] bool quit_within(std::chrono::milliseconds timeout) const {
    pollfd input{.fd = active_ ? STDIN_FILENO : -1, .events = POLLIN, .revents = 0};
    if (poll(&input, 1, static_cast<int>(timeout.count())) <= 0) return stop_signal() != 0;
    char key = 0;
    return read(STDIN_FILENO, &key, 1) <= 0 || key == 'q' || key == 'Q';
  }

 private:
  termios before_{};
  bool active_;
};

std::string state_of(const Status& status) {
  if (status.paused) return "paused";
  if (!status.waits_for.empty()) return "waits for " + status.waits_for;
  if (status.state == "loading" || status.state == "settling")
    return fmt::format("{} {:.0f} %", status.state, 100.0 * status.done_ratio);
  return status.state;
}

/// Middleware events that are no normal part of a run.
std::string events_of(const EventCounts& events) {
  std::string text;
  const auto add = [&](const char* name, std::uint64_t count) {
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", name, count);
  };
  add("deadline", events.deadline_missed);
  add("incompatible", events.incompatible_qos);
  add("lost", events.lost);
  add("rejected", events.rejected);
  add("refused", events.refused);
  return text.empty() ? kUnknown : text;
}

std::string line_of(const Status& status, const RunningProgram* here) {
  const bool world = status.program == ProgramKind::world_sim, haptic = status.program == ProgramKind::haptic_sim;
  const std::string missed = status.missed_by_os == 0
                                 ? std::to_string(status.missed_deadlines)
                                 : fmt::format("{} ({})", status.missed_deadlines, status.missed_by_os);
  return fmt::format("  {:<14} {:<11} {:>8} {:<20} {:>9.2f} {:>7.0f} {:>8.3f} {:>13} {:>6} {:>6}  {}\n",
                     label_of(status.program, status.instance), here == nullptr ? kUnknown : here->network.dds,
                     here == nullptr ? "remote" : std::to_string(here->pid), state_of(status), status.time_s,
                     status.rate_hz, 1e3 * status.step_s, missed,
                     world ? fmt::format("{:.2f}", status.real_time_factor) : kUnknown,
                     haptic ? fmt::format("{:.1f}", status.force_n) : kUnknown, events_of(status.events));
}

}  // namespace

std::string table_of(const DomainView& view) {
  std::string text = fmt::format("domain {}", view.domain);
  if (view.launcher)
    text += fmt::format(", claimed by {}",
                        *view.launcher == 0 ? "a program of another user" : fmt::format("process {}", *view.launcher));
  text += fmt::format(", {} program{}\n", view.statuses.size(), view.statuses.size() == 1 ? "" : "s");
  if (!view.fault.empty()) text += fmt::format("  cannot be joined: {}\n", view.fault);
  if (!view.statuses.empty()) {
    text += fmt::format("  {:<14} {:<11} {:>8} {:<20} {:>9} {:>7} {:>8} {:>13} {:>6} {:>6}  {}\n", "PROGRAM", "VENDOR",
                        "PID", "STATE", "TIME s", "Hz", "STEP ms", "MISSED (OS)", "FACTOR", "FORCE", "EVENTS");
  }
  for (const Status& status : view.statuses) {
    const std::string label = label_of(status.program, status.instance);
    const auto here =
        std::ranges::find_if(view.programs, [&](const RunningProgram& one) { return label_of(one) == label; });
    text += line_of(status, here == view.programs.end() ? nullptr : &*here);
  }
  if (view.statuses.empty() && view.programs.empty() && view.fault.empty())
    text += "  no program is received: none runs, or it runs in another network namespace or on another interface\n";
  bool silent = false;
  for (const RunningProgram& one : view.programs) {
    const bool heard = std::ranges::any_of(view.statuses, [&](const Status& status) {
      return label_of(status.program, status.instance) == label_of(one);
    });
    if (!heard) {
      text += fmt::format("  {:<14} {:<11} {:>8} {}\n", label_of(one), one.network.dds, one.pid,
                          one.suspended ? "suspended" : "no status received");
      silent |= !one.suspended;
    }
  }
  if (silent) text += "  of a run with keys, statuses are received with its --secure, and with its --dds\n";
  return text;
}

void show_top(const TopRequest& request) {
  Domains domains(request);
  domains.look();
  watch_stop_signals();
  if (request.once || isatty(STDOUT_FILENO) == 0) {
    std::this_thread::sleep_for(request.network.secure.empty() ? kFirstLook : kFirstSecureLook);
    fmt::print("{}", domains.text());
    return;
  }
  const Keys keys;
  bool quit = keys.quit_within(kFirstLook);
  fmt::print("\033[?25l");
  while (!quit) {
    domains.look();
    fmt::print("\033[H\033[2J{}\nq or Ctrl-C ends\n", domains.text());
    std::fflush(stdout);
    quit = keys.quit_within(kRefresh);
  }
  fmt::print("\033[?25h");
  std::fflush(stdout);
}

}  // namespace subworld
