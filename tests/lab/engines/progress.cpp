#include "lab/engines/progress.hpp"

#include "io/results/json.hpp"
#include "lab/engines/sweep.hpp"
#include "lab/page/command_line.hpp"

#include <fmt/core.h>

namespace subworld {

namespace {

constexpr double kNews_s = 30.0;  ///< a longer run prints its progress

/// Body steps.
double work_of(const EnginePoint& point) {
  return point.steps() * static_cast<double>(point.scene->scene.bodies.size());
}

std::string key_of(const EnginePoint& point) {
  return fmt::format("{}|{}|{}", point.scene->scene.name, point.engine, point.preset);
}

double seconds(std::chrono::steady_clock::duration time) { return std::chrono::duration<double>(time).count(); }

}  // namespace

double EngineProgress::expected_s(const EnginePoint& point) const {
  auto rate = rates_.find(key_of(point));
  if (rate == rates_.end()) rate = rates_.find("");
  return rate == rates_.end() ? 0.0 : rate->second.seconds / rate->second.work * work_of(point);
}

std::string EngineProgress::left(double part) const {
  if (done_ == points_.size()) return "";
  const double passed_s = seconds(Clock::now() - began_);
  double left_s = part > 0.0 ? passed_s / part * (1.0 - part) : expected_s(points_[done_]);
  for (std::size_t i = done_ + 1; i < points_.size(); ++i) {
    const bool like_this = part > 0.0 && key_of(points_[i]) == key_of(points_[done_]);
    left_s += like_this ? passed_s / part * work_of(points_[i]) / work_of(points_[done_]) : expected_s(points_[i]);
  }
  return left_text(left_s);
}

void EngineProgress::during(double t_s) {
  if (seconds(Clock::now() - news_) < kNews_s) return;
  const EnginePoint& point = points_[done_];
  say(fmt::format("          {} {} {}: {:.3g} of {:g} s{}", point.scene->scene.name, point.engine, point.preset, t_s,
                  point.duration_s, left(t_s / point.duration_s)));
}

void EngineProgress::after(const Json& row) {
  const EnginePoint& point = points_[done_++];
  const double passed_s = seconds(Clock::now() - began_);
  for (const std::string& key : {key_of(point), std::string()}) {
    rates_[key].work += work_of(point);
    rates_[key].seconds += passed_s;
  }
  began_ = Clock::now();
  const Json& step = row.at("step_s");
  const std::string failure = row.at("failure");
  const std::string verdict = !failure.empty()             ? "failed: " + failure
                              : row.at("held").get<bool>() ? "held"
                                                           : fmt::format("lost at {:.2g} s", number(row, "fell_at_s"));
  say(fmt::format("[{:3}/{}] {:<12} {:<20} {:<42} step {:8.3g} ms, max {:8.3g} ms  {}{}", done_, points_.size(),
                  point.scene->scene.name, point.engine + " " + point.preset, combination_text(row),
                  1e3 * number(step, "mean"), 1e3 * number(step, "max"), verdict, left(0.0)));
}

void EngineProgress::say(const std::string& line) {
  fmt::print("{}\n", line);
  std::fflush(stdout);
  news_ = Clock::now();
}

}  // namespace subworld
