#include "world_sim/loops/snapshots.hpp"

#include "rt/scheduling.hpp"

#include <chrono>

namespace subworld {

namespace {

constexpr double kPeriod_s = 1.0 / 30.0;
constexpr double kCompletePeriod_s = 1.0;

}  // namespace

void Snapshots::publish(const WorldView& view, bool complete) {
  if (!used()) return;
  // In lock-step a display that lags behind, or has died, would hold up the world: it misses what it cannot take.
  if (!complete && !writer_.wait_for_acknowledgments(0.0)) {
    next_s_ = view.stamp_s + kPeriod_s;
    return;
  }
  complete = complete || view.stamp_s >= next_complete_s_;
  shown_.resize(view.states.size());
  snapshot_.stamp_s = view.stamp_s;
  snapshot_.real_time_factor = view.real_time_factor;
  snapshot_.users = view.users;
  snapshot_.broken_joints = view.broken_joints;
  snapshot_.moved.clear();
  for (std::uint32_t i = 0; i < view.states.size(); ++i) {
    const BodyState& now = view.states[i];
    BodyState& shown = shown_[i];
    if (!complete && now.position == shown.position && now.orientation.coeffs() == shown.orientation.coeffs()) continue;
    shown = now;
    snapshot_.moved.push_back({BodyId{i}, now});
  }
  ++snapshot_.sequence;
  writer_.write(snapshot_);
  next_s_ = view.stamp_s + kPeriod_s;
  if (complete) next_complete_s_ = view.stamp_s + kCompletePeriod_s;
}

BackgroundSnapshots::BackgroundSnapshots(Writer<WorldSnapshot>& writer, const World& world)
    : snapshots_(writer), newest_([&] {
        WorldView view;
        world.look(view);
        return view;
      }()) {
  thread_ = std::thread([this] { work(); });
}

BackgroundSnapshots::~BackgroundSnapshots() {
  if (thread_.joinable()) finish();
}

void BackgroundSnapshots::work() {
  leave_realtime();
  std::unique_lock lock(mutex_);
  while (!wake_.wait_for(lock, std::chrono::duration<double>(kPeriod_s), [this] { return stop_; })) {
    newest_.read([this](const WorldView& view) {
      if (snapshots_.outdated(view.stamp_s)) snapshots_.publish(view, false);
    });
  }
}

void BackgroundSnapshots::renew(const World& world, double real_time_factor) {
  if (!snapshots_.used()) return;
  newest_.renew([&](WorldView& view) {
    world.look(view);
    view.real_time_factor = real_time_factor;
  });
}

void BackgroundSnapshots::finish() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_one();
  thread_.join();
  newest_.read([this](const WorldView& view) { snapshots_.publish(view, true); });
}

}  // namespace subworld
