#include "link/model.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace subworld {

namespace {

/// t of the jitter of a packet's copy, from two numbers in 0 .. 1 that are independent and even. Normal: the two values
/// of Box and Muller (1958), one for each copy. Else the copy's own number, at which the distribution is inverted.
double jitter_of(JitterShape shape, const std::array<double, 2>& drawn, int copy) noexcept {
  constexpr double kCutOff = 4.0;  // netem's tables hold 16 bits with 8192 as 1
  const double u = drawn[copy];
  switch (shape) {
    case JitterShape::uniform:
      return 2.0 * u - 1.0;
    case JitterShape::normal: {
      const double radius = std::sqrt(-2.0 * std::log1p(-drawn[0])), angle = 2.0 * std::numbers::pi * drawn[1];
      return std::clamp(radius * (copy == 0 ? std::cos(angle) : std::sin(angle)), -kCutOff, kCutOff);
    }
    case JitterShape::pareto:
      return std::min(kCutOff, (4.0 / 3.0) * (1.0 / std::cbrt(1.0 - u) - 1.5));
  }
  return 0.0;
}

}  // namespace

LinkModel::LinkModel(const LinkSettings& settings, std::uint64_t seed) : settings_(settings), random_(seed) {}

bool LinkModel::is_lost(double turn, double loss) noexcept {
  const LossModel& model = settings_.loss;
  const double ratio = bad_ ? model.loss_in_bad : model.loss_in_good;
  if (turn < (bad_ ? model.r : model.p)) bad_ = !bad_;
  return loss < ratio;
}

std::int64_t LinkModel::departure(std::int64_t now_ns, int bytes, double t) noexcept {
  const double delay_s = std::max(0.0, settings_.delay_s + settings_.jitter_s * t);
  const std::int64_t arrived_ns = now_ns + std::llround(delay_s * 1e9);
  if (settings_.rate_bit_s <= 0.0) return arrived_ns;
  last_ns_ = std::max(arrived_ns, last_ns_) + std::llround(8e9 * bytes / settings_.rate_bit_s);
  return last_ns_;
}

PacketFate LinkModel::arrive(std::int64_t now_ns, int bytes) noexcept {
  const double duplicate = draw(), turn = draw(), loss = draw(), reorder = draw();
  const std::array delays{draw(), draw()};
  const bool lost = is_lost(turn, loss);
  if (settings_.outage.holds(1e-9 * static_cast<double>(now_ns))) return {.drop = LinkDrop::outage};
  const int copies = 1 + (duplicate < settings_.duplicate_ratio ? 1 : 0) - (lost ? 1 : 0);
  if (copies == 0) return {.drop = LinkDrop::loss};
  PacketFate fate;
  for (int i = 0; i < copies && waiting_ < settings_.limit; ++i) {
    const bool overtakes = since_reordered_ >= settings_.reorder_gap - 1 && reorder < settings_.reorder_ratio;
    since_reordered_ = overtakes ? 0 : since_reordered_ + 1;
    fate.departure_ns[i] = overtakes ? now_ns : departure(now_ns, bytes, jitter_of(settings_.shape, delays, i));
    ++fate.copies;
    ++waiting_;
  }
  if (fate.copies == 0) fate.drop = LinkDrop::queue;
  return fate;
}

}  // namespace subworld
