#include "world_sim/body_history.hpp"

#include "model/error.hpp"
#include "model/joined.hpp"
#include "model/scene/body_choice.hpp"
#include "rt/cyclic.hpp"
#include "world_sim/world.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

namespace subworld {

namespace {

constexpr double kMostRows_hz = 10'000.0;  ///< a simulated second without a rate: 1.5 MB, and a spreadsheet holds 100 s
constexpr double kSafety = 2.0;            ///< times the cost: the time that an instant needs to be left
constexpr double kCheap = 0.01;            ///< part of a cycle that an instant may take whatever is left of it
constexpr double kSlowly = 1.1;            ///< by which the cost may rise: a writer held up once is no slow one
constexpr std::size_t kWidth = 15;

const char* const kHead =
    "time_s,body,x_m,y_m,z_m,qw,qx,qy,qz,velocity_x_m_s,velocity_y_m_s,velocity_z_m_s,angular_velocity_x_rad_s,"
    "angular_velocity_y_rad_s,angular_velocity_z_rad_s\n";

BodyRecording recording_of(const Options& options, const Scene& scene) {
  BodyRecording recording;
  if (!options.bodies) return recording;
  recording.bodies = choose_bodies(scene, *options.bodies);
  for (const BodyId id : recording.bodies) recording.names.push_back(scene.body(id).name);
  recording.may_wait = scene.settings.mode == Mode::lockstep;
  if (options.bodies_rate_hz) {
    recording.interval_s = 1.0 / *options.bodies_rate_hz;
    return recording;
  }
  const double cycle_s = scene.settings.shortest_cycle_s();
  const double cycles = std::ceil(static_cast<double>(recording.bodies.size()) / kMostRows_hz / cycle_s - 1e-9);
  if (cycles > 1.0) recording.interval_s = cycles * cycle_s;
  return recording;
}

/// Rows are time, which of the bodies, and its state.
History::Format format_of(const BodyRecording& recording) {
  return {.width = kWidth,
          .head = kHead,
          .row =
              [names = recording.names](std::string& text, std::span<const double> row) {
                text += fmt::format("{:.9g},{},{}\n", row[0], names[static_cast<std::size_t>(row[1])],
                                    joined(row.subspan(2), ",", "{:.9g}"));
              },
          .rows = std::max(History::kRows, 2 * recording.bodies.size())};
}

std::string path_in(const std::string& folder, const BodyRecording& recording) {
  if (recording.bodies.empty()) return {};
  if (folder.empty()) throw Error(ExitCode::usage, "--bodies needs a folder for its file; name one with --out");
  return folder + "/bodies.csv";
}

}  // namespace

BodyHistory::BodyHistory(const Options& options, const Scene& scene, History::Say say)
    : recording_(recording_of(options, scene)),
      history_(path_in(options.out, recording_), format_of(recording_), std::move(say)) {}

void BodyHistory::record(const World& world, double room_s) noexcept {
  if (recording_.bodies.empty()) return;
  if (recording_.interval_s > 0.0) {
    const auto instant = static_cast<std::int64_t>(std::floor(world.facts().time_s / recording_.interval_s + 1e-6));
    if (instant <= instant_) return;
    instant_ = instant;
  }
  if (room_s < kSafety * cost_s_ && cost_s_ > kCheap * world.facts().cycle_s) {
    cost_s_ /= kSlowly;  // and is tried again before long
    drop(world.facts().time_s);
    return;
  }
  const TimePoint begin = Clock::now();
  if (!write(world, recording_.may_wait)) {
    drop(world.facts().time_s);
    return;
  }
  const double took_s = to_seconds(Clock::now() - begin);
  cost_s_ = cost_s_ > 0.0 ? std::min(took_s, kSlowly * cost_s_) : took_s;
}

void BodyHistory::record_now(const World& world) noexcept {
  if (recording_.bodies.empty() || world.facts().time_s == written_s_) return;
  instant_ = std::max<std::int64_t>(instant_, 0);
  if (world.facts().time_s == dropped_s_) dropped_ -= recording_.bodies.size();
  if (!write(world, true)) drop(world.facts().time_s);
}

void BodyHistory::drop(double time_s) noexcept {
  dropped_ += recording_.bodies.size();
  dropped_s_ = time_s;
}

bool BodyHistory::write(const World& world, bool may_wait) noexcept {
  const std::size_t count = recording_.bodies.size();
  if (!history_.make_room(count, may_wait)) return false;
  written_s_ = world.facts().time_s;
  for (std::size_t i = 0; i < count; ++i) {
    const BodyState s = world.engine().state(recording_.bodies[i]);
    history_.row_of(written_s_, i, s.position, s.orientation, s.linear_velocity, s.angular_velocity);
  }
  rows_ += count;
  return true;
}

std::optional<BodyHistoryResult> BodyHistory::result() {
  history_.finish();
  if (recording_.bodies.empty()) return {};
  return BodyHistoryResult{
      .bodies = recording_.bodies.size(), .interval_s = recording_.interval_s, .rows = rows_, .rows_dropped = dropped_};
}

}  // namespace subworld
