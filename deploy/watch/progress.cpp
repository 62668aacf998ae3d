#include "watch/progress.hpp"

#include "io/options/live_options.hpp"
#include "model/joined.hpp"
#include "wire/session.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <utility>
#include <vector>

namespace subworld {

namespace {

constexpr int kCallsPerLine = 50, kFirstLine = 10;  ///< of ten calls a second, where lines are not rewritten
constexpr double kSlow = 0.9;                       ///< real-time factor below which the remaining time is shown
constexpr double kStalled_s = 3.0;                  ///< a loop in lock-step names after 2 s the peer that it waits for

std::string starting_line(const Status& world, std::size_t bodies) {
  if (world.state != "loading" && world.state != "settling") return world.state;
  return fmt::format("{} {}: {:.0f} %", world.state == "loading" ? "creating" : "settling", bodies_text(bodies),
                     100.0 * world.done_ratio);
}

}  // namespace

std::string bodies_text(std::size_t count) { return fmt::format("{} {}", count, count == 1 ? "body" : "bodies"); }

std::string progress_line(const Statuses& statuses, const Settings& settings, std::size_t bodies) {
  const auto world = statuses.find({ProgramKind::world_sim, 0});
  if (world == statuses.end()) return "reading " + bodies_text(bodies);
  if (world->second.state != "running" || world->second.steps == 0) return starting_line(world->second, bodies);
  const bool realtime = settings.mode == Mode::realtime;
  double rate_hz = 0.0;
  std::uint64_t missed = 0, by_os = 0;
  std::vector<std::string> forces;
  for (const auto& [who, status] : statuses) {
    if (who.first != ProgramKind::haptic_sim) continue;
    rate_hz = forces.empty() ? status.rate_hz : std::min(rate_hz, status.rate_hz);
    missed += status.missed_deadlines;
    by_os += status.missed_by_os;
    forces.push_back(fmt::format("{:.1f}", status.force_n));
  }
  std::string line =
      fmt::format("t = {:.1f} of {:g} s", std::min(world->second.time_s, settings.duration_s), settings.duration_s);
  if (world->second.paused) return line + "; paused";
  if (forces.empty()) return line;
  line += fmt::format("; {:.0f} Hz; force {} N", rate_hz, joined(forces, ", "));
  if (realtime) {
    line += fmt::format("; missed {}{}; real-time factor {:.2f}", missed,
                        by_os == 0 ? "" : fmt::format(" ({} by the OS)", by_os), world->second.real_time_factor);
    const double left_s = settings.duration_s - world->second.time_s;
    const double factor = world->second.real_time_factor;
    if (factor > 0.0 && factor < kSlow && left_s > 0.0) line += fmt::format(", {:.0f} s left", left_s / factor);
  }
  return line;
}

Progress::Progress(const Network& network, const Scene& scene, Watchdog& watchdog)
    : scene_(scene), watchdog_(watchdog), terminal_(isatty(STDOUT_FILENO) != 0) {
  // A reader of real-time quality matches programs in both modes.
  Settings listening;
  listening.mode = Mode::realtime;
  listening.users = scene.settings.users;
  try {
    bus_ = open_bus(network, listening, 0.001, "subworld run");
    reader_ = std::make_unique<Reader<Status>>(bus_->reader<Status>());
  } catch (const Error&) {
    // The programs report the same error, and end.
    bus_.reset();
  }
}

Progress::~Progress() { finish(); }

void Progress::operator()() {
  listen();
  const std::string line = progress_line(statuses_, scene_.settings, scene_.bodies.size());
  if (terminal_) {
    if (shown_ && line == line_) return;
    line_ = line;
    fmt::print("\r\033[K{}", line);
    shown_ = true;
  } else if (++calls_ % kCallsPerLine == kFirstLine) {
    fmt::print("{}\n", line);
  }
  std::fflush(stdout);
}

bool Progress::run_is_over() {
  listen();
  return over_;
}

bool Progress::awaits_verdict() {
  listen();
  const auto display = statuses_.find({ProgramKind::gui_headless, 0});
  return display != statuses_.end() && display->second.state == kAwaitsVerdict;
}

void Progress::finish() {
  if (shown_) fmt::print("\r\033[K");
  shown_ = false;
  std::fflush(stdout);
}

void Progress::listen() {
  while (reader_ && reader_->take(status_) == Take::sample) {
    say(status_);
    warn_of_overload(status_);
    watch(status_);
    over_ = over_ || (status_.program == ProgramKind::world_sim && status_.state == "stopping");
    statuses_[{status_.program, status_.instance}] = status_;
  }
}

void Progress::say(const Status& status) {
  // `subworld control` prints the answers to orders.
  if (status.text.empty() || !said_.insert(status.text).second) return;
  finish();
  fmt::print("{}: {}\n", label_of(status.program, status.instance), status.text);
}

void Progress::watch(const Status& status) {
  if (status.program == ProgramKind::gui_headless) return;
  const std::chrono::duration<double> now = std::chrono::steady_clock::now().time_since_epoch();
  const std::string text = watchdog_.observe(status, now.count());
  if (text.empty()) return;
  finish();
  fmt::print(stderr, "subworld: {}\n", text);
}

void Progress::warn_of_overload(const Status& status) {
  if (scene_.settings.mode != Mode::realtime || status.program != ProgramKind::haptic_sim) return;
  if (status.step_s <= scene_.settings.h_s ||
      !said_.insert("overload of " + label_of(status.program, status.instance)).second)
    return;
  finish();
  fmt::print(
      "{}: cannot keep up: a step takes {:.2f} ms of {:.2f} ms; choose a lower budget_ratio or a smaller box_half_m, "
      "the preset fast, or a longer h_s\n",
      label_of(status.program, status.instance), 1e3 * status.step_s, 1e3 * scene_.settings.h_s);
}

std::string Watchdog::observe(const Status& status, double now_s) {
  if (status.program == ProgramKind::world_sim) paused_ = status.paused;
  Clock& clock = clocks_[{status.program, status.instance}];
  const bool steps = status.state == "running" && status.steps > 0;
  std::string label = label_of(status.program, status.instance);
  std::ranges::replace(label, ' ', '_');  // as its log is named
  if (!steps || paused_ || status.time_s != clock.time_s) {
    const bool advances = clock.named && steps && !paused_;
    clock = {status.time_s, now_s, false};
    return advances ? label + " advances again" : "";
  }
  const double stalled_s = now_s - clock.since_s;
  if (stalled_s <= kStalled_s || !status.waits_for.empty()) return {};
  if (stalled_s > longest_.for_s) longest_ = {label, status.time_s, stalled_s};
  if (std::exchange(clock.named, true)) return {};
  return fmt::format("{} has not advanced from t = {:.3f} s for {:.0f} s and waits for no peer: it is busy or stuck",
                     label, status.time_s, stalled_s);
}

}  // namespace subworld
