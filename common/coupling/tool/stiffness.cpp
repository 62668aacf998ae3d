#include "coupling/tool/stiffness.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <vector>

namespace subworld {

namespace {

using Complex = std::complex<double>;

/// Least damping that differs from none, N s/m for each kg: the formulas divide by it.
constexpr double kLeastDamping_per_s = 1e-6;

class Loop {
 public:
  explicit Loop(const SampledWall& wall)
      : wall_(wall), b_(std::max(wall.damping_n_s_m, kLeastDamping_per_s * wall.mass_kg)) {}

  /// Equation (3) at z = exp(i w), w in (0, pi].
  [[nodiscard]] Complex stiffness(double w) const {
    const Complex z = std::polar(1.0, w);
    const double rate = b_ * wall_.period_s / wall_.mass_kg;
    const double gone = -std::expm1(-rate);  // 1 - a
    const double tau = wall_.mass_kg / b_;
    const Complex gv = gone / b_ / (z - (1.0 - gone));
    const Complex gx = (tau * gone * gv + (wall_.period_s - tau * gone) / b_) / (z - 1.0);
    return -(std::pow(z, wall_.delay) + wall_.wall_damping_n_s_m * gv) / gx;
  }
  /// The least positive real K on the edge.
  [[nodiscard]] double edge() const {
    const int steps = 4000 * (1 + wall_.delay);
    double least = std::numeric_limits<double>::infinity();
    const auto offer = [&](double k) {
      if (k > 0.0) least = std::min(least, k);
    };
    offer(stiffness(M_PI).real());
    double below = M_PI / steps;
    for (int i = 2; i < steps; ++i) {
      const double above = M_PI * i / steps;
      if (stiffness(below).imag() * stiffness(above).imag() <= 0.0) offer(stiffness(crossing(below, above)).real());
      below = above;
    }
    return least;
  }

 private:
  [[nodiscard]] double crossing(double below, double above) const {
    const double sign = stiffness(below).imag();
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (below + above);
      (stiffness(middle).imag() * sign > 0.0 ? below : above) = middle;
    }
    return above;
  }

  const SampledWall& wall_;
  double b_;
};

/// Whether the damping B alone, K = 0, holds: v_{k+1} = a v_k - (1 - a) / b B v_{k-n}, by running it.
bool damping_holds(const SampledWall& wall) {
  const double b = std::max(wall.damping_n_s_m, kLeastDamping_per_s * wall.mass_kg);
  const double gone = -std::expm1(-b * wall.period_s / wall.mass_kg);
  std::vector<double> past(static_cast<std::size_t>(wall.delay) + 1, 0.0);
  double v = 1.0;
  const std::size_t steps = 2000 * past.size();
  for (std::size_t k = 0; k < steps && std::abs(v) < 1e6; ++k) {
    past[k % past.size()] = v;
    v = (1.0 - gone) * v - gone / b * wall.wall_damping_n_s_m * past[(k + 1) % past.size()];
  }
  return std::abs(v) < 1.0;
}

}  // namespace

double largest_stiffness(const SampledWall& wall) { return damping_holds(wall) ? Loop(wall).edge() : 0.0; }

double largest_stiffness(const UserSpec& user, const Settings& settings) {
  const DeviceSpec& device = user.device;
  const double period_s = std::max(settings.h_s, 1.0 / device.rate_hz);
  const double delay_s = settings.delay.from_device_s + settings.delay.to_device_s;
  return largest_stiffness({.mass_kg = device.mass_kg,
                            .damping_n_s_m = device.damping_n_s_m,
                            .period_s = period_s,
                            .delay = static_cast<int>(std::ceil(delay_s / period_s - 1e-9)),
                            .wall_damping_n_s_m = user.coupling.damping_n_s_m});
}

}  // namespace subworld
