#include "lab/stability/formulas.hpp"

#include "lab/stability/bed.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace subworld {

double slide_distance_m(double speed_m_s, double mu) { return speed_m_s * speed_m_s / (2.0 * mu * kG); }

SlideToRoll slide_to_roll(double v0_m_s, double k, double mu) {
  SlideToRoll motion;
  motion.speed_m_s = v0_m_s / (1.0 + k);
  motion.sliding_s = k * v0_m_s / ((1.0 + k) * mu * kG);
  motion.sliding_m = 0.5 * (v0_m_s + motion.speed_m_s) * motion.sliding_s;
  return motion;
}

double slip_angle_deg(double mu) { return std::atan(mu) / kDegree; }

double tip_angle_deg(double width_over_height) { return std::atan(width_over_height) / kDegree; }

double groove_force_n(double weight_n, double half_angle_deg) {
  return weight_n / (2.0 * std::sin(half_angle_deg * kDegree));
}

double groove_height_m(double radius_m, double half_angle_deg) { return radius_m / std::sin(half_angle_deg * kDegree); }

double disc_spin_s(double rate_rad_s, double radius_m, double mu) {
  return 3.0 * radius_m * rate_rad_s / (4.0 * mu * kG);
}

double tumble_period_s(const Vec3& inertia, const Vec3& body_rate_rad_s) {
  Vec3 i = inertia;
  std::sort(i.begin(), i.end());
  const Vec3 momentum = inertia.cwiseProduct(body_rate_rad_s);
  const double l2 = momentum.squaredNorm(), e2 = momentum.dot(body_rate_rad_s);  // L^2, 2 E
  if (l2 < e2 * i[1]) std::swap(i[0], i[2]);
  const double slow = (i[2] - i[1]) * (l2 - e2 * i[0]), fast = (i[1] - i[0]) * (e2 * i[2] - l2);
  return 4.0 * std::comp_ellint_1(std::sqrt(fast / slow)) * std::sqrt(i.prod() / slow);
}

double precession_rad_s(double weight_moment_n_m, double i1, double i3, double w3_rad_s, double theta_rad) {
  const double a = i1 * std::cos(theta_rad), b = i3 * w3_rad_s;
  const double root = b * b - 4.0 * a * weight_moment_n_m;
  if (root < 0.0) return std::numeric_limits<double>::quiet_NaN();
  return 2.0 * weight_moment_n_m / (b + std::sqrt(root));
}

FreeBody turned_by_euler(const Vec3& inertia, FreeBody body, double duration_s) {
  constexpr double kLongestStep_s = 1e-4;
  struct Slope {
    Vec3 rate;
    Eigen::Vector4d turn;
  };
  const auto slope = [&](const FreeBody& at) {
    const Vec3& w = at.rate_rad_s;
    const Quat spin = at.orientation * Quat(0.0, w.x(), w.y(), w.z());
    return Slope{inertia.cwiseProduct(w).cross(w).cwiseQuotient(inertia), 0.5 * spin.coeffs()};
  };
  const auto ahead = [&](const Slope& s, double h) {
    FreeBody there = body;
    there.rate_rad_s += h * s.rate;
    there.orientation.coeffs() += h * s.turn;
    return there;
  };
  const auto steps = std::max(1L, std::lround(std::ceil(duration_s / kLongestStep_s)));
  const double h = duration_s / static_cast<double>(steps);
  for (long n = 0; n < steps; ++n) {
    const Slope a = slope(body), b = slope(ahead(a, 0.5 * h)), c = slope(ahead(b, 0.5 * h)), d = slope(ahead(c, h));
    body.rate_rad_s += h / 6.0 * (a.rate + 2.0 * b.rate + 2.0 * c.rate + d.rate);
    body.orientation.coeffs() += h / 6.0 * (a.turn + 2.0 * b.turn + 2.0 * c.turn + d.turn);
    body.orientation.normalize();
  }
  return body;
}

}  // namespace subworld
