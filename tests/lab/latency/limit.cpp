#include "lab/latency/limit.hpp"

#include "lab/coupling/analysis.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace subworld {

namespace {

double excess(double value, double bound) noexcept {
  if (!(value > bound)) return std::isnan(value) ? std::numeric_limits<double>::infinity() : 0.0;
  return bound > 0.0 ? value / bound : std::numeric_limits<double>::infinity();
}

std::string milliseconds(double s) { return fmt::format("{:.4g} ms", 1e3 * s); }

const UserLimit* least_of(std::span<const UserLimit> users) {
  const UserLimit* least = nullptr;
  const auto of = [](const UserLimit& user) { return user.limit.within_s.value_or(-1.0); };
  for (const UserLimit& user : users) {
    if (!user.undecided.empty()) continue;
    // Of users that were within up to the largest delay, one whose limit was found comes first.
    const bool less = least == nullptr || of(user) < of(*least) ||
                      (of(user) == of(*least) && user.limit.beyond && !least->limit.beyond);
    if (less) least = &user;
  }
  return least;
}

std::string verdict_of(const Question& question, const UserLimit& least, bool several) {
  const Limit& limit = least.limit;
  const std::string whose = several ? fmt::format(" for user {}", least.name) : "";
  const auto why = [&] { return text_of(*limit.limited_by, limit.beyond->values[*limit.limited_by]); };
  const std::string so_far =
      limit.within_s ? fmt::format("up to {} of {} cannot be felt so far", milliseconds(*limit.within_s), question.link)
                     : "no delay was within the bounds so far";
  if (!question.disturbed.empty())
    return fmt::format(
        "no limit: this machine was too busy for the programs of the run ({}); {}; end other programs and "
        "search again, or use a machine with more cores",
        question.disturbed, so_far);
  if (!question.finished) return "stopped before the limit was found; " + so_far;
  if (limit.within_s.value_or(0.0) == 0.0 && limit.beyond) {
    const double s = limit.beyond->delay_s;
    return fmt::format("no {} is imperceptible: {} {}{}", question.link,
                       s > 0.0 ? fmt::format("already at {}", milliseconds(s)) : "without delay", why(), whose);
  }
  if (!limit.beyond) {
    return fmt::format("{} of {}, the largest that was looked at, cannot be felt", milliseconds(*limit.within_s),
                       question.link);
  }
  return fmt::format("up to {} of {} cannot be felt; beyond it {}{}", milliseconds(*limit.within_s), question.link,
                     why(), whose);
}

}  // namespace

Criteria default_bounds() noexcept {
  Criteria bounds;
  bounds[Criterion::rms] = kImperceptibleRms;
  bounds[Criterion::p99] = kImperceptibleP99;
  bounds[Criterion::offset] = kImperceptibleOffset_s;
  bounds[Criterion::energy] = 1e-3;
  bounds[Criterion::oscillation] = 0.5;
  bounds[Criterion::stiffness] = 1.0;
  return bounds;
}

std::optional<Criterion> exceeded(const Criteria& values, const Criteria& bounds) noexcept {
  std::optional<Criterion> worst;
  double most = 0.0;
  for (const CriterionText& text : kCriterionTexts) {
    const double by = excess(values[text.criterion], bounds[text.criterion]);
    if (by <= most) continue;
    most = by;
    worst = text.criterion;
  }
  return worst;
}

double nearness(const Criteria& values, const Criteria& bounds) noexcept {
  double most = 0.0;
  for (const CriterionText& text : kCriterionTexts) {
    if (bounds[text.criterion] > 0.0) most = std::max(most, values[text.criterion] / bounds[text.criterion]);
  }
  return most;
}

std::string text_of(Criterion criterion, double value) {
  const CriterionText& text = kCriterionTexts[static_cast<std::size_t>(criterion)];
  if (criterion == Criterion::unstable) return text.subject;
  if (criterion == Criterion::stiffness && std::isinf(value))
    return "the damping of the coupling alone makes the device oscillate in a wall";
  return fmt::format("{} {:.3g}{}", text.subject, text.scale * value, text.unit);
}

Limit limit_of(std::span<const Sample> samples, const Criteria& bounds) {
  Limit limit;
  for (const Sample& sample : samples) {
    limit.limited_by = exceeded(sample.values, bounds);
    if (limit.limited_by && sample.disturbed) return {.within_s = limit.within_s, .beyond = {}, .limited_by = {}};
    if (limit.limited_by) {
      limit.beyond = sample;
      break;
    }
    limit.within_s = sample.delay_s;
  }
  return limit;
}

std::string sentence_of(const Question& question, std::span<const UserLimit> users) {
  std::string text = fmt::format("{}: {} user{}: ", question.scene, users.size(), users.size() == 1 ? "" : "s");
  const UserLimit* const least = least_of(users);
  if (least != nullptr) text += verdict_of(question, *least, users.size() > 1);
  for (const UserLimit& user : users) {
    if (user.undecided.empty()) continue;
    if (!text.ends_with(": ")) text += "; ";
    text += fmt::format("{}cannot be decided: {}", users.size() > 1 ? fmt::format("user {} ", user.name) : "",
                        user.undecided);
  }
  return text;
}

}  // namespace subworld
