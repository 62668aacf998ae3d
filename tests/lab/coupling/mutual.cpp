#include "lab/coupling/mutual.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace subworld {

namespace {

constexpr double kAnswer_s = 0.2;      ///< in which a reference answers
constexpr double kLeastForce_n = 0.1;  ///< of a user who presses

constexpr int kInstants = 5;

/// Instants at which user A and another user press, s: evenly over all steps at which they do.
std::vector<double> instants_of(const std::vector<FeltHistory>& felt, std::size_t user, double h_s) {
  const std::size_t steps = felt[user].force.size();
  const auto window = static_cast<std::size_t>(kLongest_s / h_s);
  std::vector<std::size_t> both;
  for (std::size_t i = 0; i + window < steps; ++i) {
    const auto presses = [&](const FeltHistory& of) { return of.force[i].norm() > kLeastForce_n; };
    if (presses(felt[user]) && std::ranges::count_if(felt, presses) > 1) both.push_back(i);
  }
  std::vector<double> instants;
  for (std::size_t k = 0; k < kInstants && !both.empty(); ++k)
    instants.push_back(h_s * static_cast<double>(both[(2 * k + 1) * both.size() / (2 * kInstants)]));
  return instants;
}

/// The run with the nudge, until it has been answered.
std::optional<Outcome> nudged(Scene scene, std::size_t user, double at_s, const Vec3& displacement, double for_s,
                              const Prepare& prepare = {}) {
  scene.users[user].device.path.push_back(
      {.kind = PathSegment::Kind::move, .from_s = at_s, .to_s = at_s + kNudge_s, .displacement = displacement});
  scene.settings.duration_s = std::min(scene.settings.duration_s, at_s + for_s);
  return run_out(scene, prepare);
}

/// (1), from at_s on, N.
std::vector<double> answer_of(const FeltHistory& with, const FeltHistory& without, double at_s, double h_s) {
  std::vector<double> answer;
  const std::size_t n = std::min(with.force.size(), without.force.size());
  for (auto i = static_cast<std::size_t>(std::lround(at_s / h_s)); i < n; ++i)
    answer.push_back((with.force[i] - without.force[i]).norm());
  return answer;
}

/// The time at which the answer first reaches the level, linear between samples.
double reached_s(const std::vector<double>& answer, double level_n, double h_s) {
  for (std::size_t i = 1; i < answer.size(); ++i) {
    if (answer[i] >= level_n)
      return h_s * (static_cast<double>(i) - (answer[i] - level_n) / (answer[i] - answer[i - 1]));
  }
  return std::numeric_limits<double>::infinity();
}

}  // namespace

const std::vector<MutualLatencies::Nudge>* MutualLatencies::nudges_of(const Point& point, const Reference& reference) {
  const std::string key = reference_key(point);
  if (const auto found = known_.find(key); found != known_.end()) return &found->second;
  const Scene scene = reference_scene_of(point);
  const double h_s = scene.settings.h_s;
  std::vector<Nudge> nudges;
  const std::vector<FeltHistory>& felt = reference.run.felt;
  for (std::size_t user = 0; user < felt.size(); ++user) {
    Nudge best{.user = user};
    double most_n = 0.0;
    for (const double at_s : instants_of(felt, user, h_s)) {
      const Vec3 force = felt[user].force[static_cast<std::size_t>(std::lround(at_s / h_s))];
      Nudge nudge{.user = user, .at_s = at_s, .displacement = kNudge_m * force.normalized()};
      const std::optional<Outcome> run = nudged(scene, user, at_s, nudge.displacement, kAnswer_s);
      if (!run) return nullptr;
      double all_n = 0.0;
      const double least_n = kLeastShare * scene.users[user].coupling.stiffness_n_m * kNudge_m;
      for (std::size_t by = 0; by < felt.size(); ++by) {
        if (by == user) continue;
        const std::vector<double> answer = answer_of(run->felt[by], felt[by], at_s, h_s);
        const double level_n = 0.5 * *std::ranges::max_element(answer);
        if (2.0 * level_n < least_n) continue;
        nudge.answers.push_back({by, level_n, reached_s(answer, level_n, h_s)});
        all_n += level_n;
      }
      if (all_n <= most_n) continue;
      most_n = all_n;
      best = std::move(nudge);
    }
    nudges.push_back(std::move(best));
  }
  return &known_.emplace(key, std::move(nudges)).first->second;
}

bool MutualLatencies::measure(const Point& point, const Outcome& run, const Reference& reference,
                              std::vector<std::optional<MutualLatency>>& late) {
  const std::vector<Nudge>* const nudges = nudges_of(point, reference);
  if (nudges == nullptr) return false;
  const Scene scene = scene_of(point);
  for (const Nudge& nudge : *nudges) {
    if (nudge.answers.empty()) continue;
    const std::optional<Outcome> with =
        nudged(scene, nudge.user, nudge.at_s, nudge.displacement, kLongest_s, prepare_of(point));
    if (!with) return false;
    for (const Answer& answer : nudge.answers) {
      const std::vector<double> mine =
          answer_of(with->felt[answer.by], run.felt[answer.by], nudge.at_s, scene.settings.h_s);
      const double at_s = reached_s(mine, answer.level_n, scene.settings.h_s);
      const double late_s = std::min(kLongest_s, at_s - answer.after_s);
      std::optional<MutualLatency>& worst = late[answer.by];
      if (!worst || late_s > worst->late_s) worst = {late_s, nudge.user, answer.after_s};
    }
  }
  return true;
}

}  // namespace subworld
