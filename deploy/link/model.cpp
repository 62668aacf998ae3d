#include "link/model.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr double kCutOff = 4.0;  // netem's tables hold 16 bits with 8192 as 1

/// Quantile of the standard normal distribution (Acklam 2003), relative error 1.2e-9.
double normal_quantile(double u) noexcept {
  constexpr std::array a{-3.969683028665376e+01, 2.209460984245205e+02,  -2.759285104469687e+02,
                         1.383577518672690e+02,  -3.066479806614716e+01, 2.506628277459239e+00};
  constexpr std::array b{-5.447609879822406e+01, 1.615858368580409e+02, -1.556989798598866e+02, 6.680131188771972e+01,
                         -1.328068155288572e+01};
  constexpr std::array c{-7.784894002430293e-03, -3.223964580411365e-01, -2.400758277161838e+00,
                         -2.549732539343734e+00, 4.374664141464968e+00,  2.938163982698783e+00};
  constexpr std::array d{7.784695709041462e-03, 3.224671290700398e-01, 2.445134137142996e+00, 3.754408661907416e+00};
  const auto tail = [&](double q) {
    return (((((c[0] * q + c[1]) * q + c[2]) * q + c[3]) * q + c[4]) * q + c[5]) /
           ((((d[0] * q + d[1]) * q + d[2]) * q + d[3]) * q + 1.0);
  };
  constexpr double kLow = 0.02425;
  if (u < kLow) return tail(std::sqrt(-2.0 * std::log(u)));
  if (u > 1.0 - kLow) return -tail(std::sqrt(-2.0 * std::log(1.0 - u)));
  const double q = u - 0.5, s = q * q;
  return (((((a[0] * s + a[1]) * s + a[2]) * s + a[3]) * s + a[4]) * s + a[5]) * q /
         (((((b[0] * s + b[1]) * s + b[2]) * s + b[3]) * s + b[4]) * s + 1.0);
}

}  // namespace

double jitter_quantile(JitterShape shape, double u) noexcept {
  u = std::clamp(u, 1e-15, 1.0 - 1e-15);
  switch (shape) {
    case JitterShape::uniform:
      return 2.0 * u - 1.0;
    case JitterShape::normal:
      return std::clamp(normal_quantile(u), -kCutOff, kCutOff);
    case JitterShape::pareto:
      return std::min(kCutOff, (4.0 / 3.0) * (1.0 / std::cbrt(1.0 - u) - 1.5));
  }
  return 0.0;
}

LinkModel::LinkModel(const LinkSettings& settings, std::uint64_t seed) : settings_(settings), random_(seed) {}

bool LinkModel::is_lost(double turn, double loss) noexcept {
  const LossModel& model = settings_.loss;
  const double ratio = bad_ ? model.loss_in_bad : model.loss_in_good;
  if (turn < (bad_ ? model.r : model.p)) bad_ = !bad_;
  return loss < ratio;
}

std::int64_t LinkModel::departure(std::int64_t now_ns, int bytes, double u) noexcept {
  const double delay_s =
      std::max(0.0, settings_.delay_s +
                        (settings_.jitter_s > 0.0 ? settings_.jitter_s * jitter_quantile(settings_.shape, u) : 0.0));
  const std::int64_t arrived_ns = now_ns + std::llround(delay_s * 1e9);
  if (settings_.rate_bit_s <= 0.0) return arrived_ns;
  last_ns_ = std::max(arrived_ns, last_ns_) + std::llround(8e9 * bytes / settings_.rate_bit_s);
  return last_ns_;
}

PacketFate LinkModel::arrive(std::int64_t now_ns, int bytes) noexcept {
  const double duplicate = draw(), turn = draw(), loss = draw(), reorder = draw();
  const std::array delays{draw(), draw()};
  const bool lost = is_lost(turn, loss);
  PacketFate fate;
  if (settings_.outage.holds(1e-9 * static_cast<double>(now_ns))) {
    fate.drop = LinkDrop::outage;
    return fate;
  }
  const int copies = 1 + (duplicate < settings_.duplicate_ratio ? 1 : 0) - (lost ? 1 : 0);
  if (copies == 0) {
    fate.drop = LinkDrop::loss;
    return fate;
  }
  for (int i = 0; i < copies && waiting_ < settings_.limit; ++i) {
    const bool overtakes = since_reordered_ >= settings_.reorder_gap - 1 && reorder < settings_.reorder_ratio;
    since_reordered_ = overtakes ? 0 : since_reordered_ + 1;
    fate.departure_ns[i] = overtakes ? now_ns : departure(now_ns, bytes, delays[i]);
    ++fate.copies;
    ++waiting_;
  }
  if (fate.copies == 0) fate.drop = LinkDrop::queue;
  return fate;
}

}  // namespace subworld
