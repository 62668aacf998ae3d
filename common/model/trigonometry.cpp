#include "model/trigonometry.hpp"

#include <cmath>

namespace subworld {

SinCos sin_cos_deg(double degrees) noexcept {
  const double turn = std::fmod(degrees, 360.0);  // exact
  const double quarter = std::floor(turn / 90.0 + 0.5);
  const double x = (turn - 90.0 * quarter) * (M_PI / 180.0);  // -pi/4 .. pi/4
  const double x2 = x * x;
  double sine = 1.0;
  double cosine = 1.0;
  // Taylor series from the smallest term on; x^18 / 18! is below the last bit.
  for (int n = 17; n >= 3; n -= 2) sine = 1.0 - x2 / (n * (n - 1)) * sine;
  for (int n = 18; n >= 2; n -= 2) cosine = 1.0 - x2 / (n * (n - 1)) * cosine;
  sine *= x;
  switch ((static_cast<int>(quarter) % 4 + 4) % 4) {
    case 0:
      return {sine, cosine};
    case 1:
      return {cosine, -sine};
    case 2:
      return {-sine, -cosine};
    default:
      return {-cosine, sine};
  }
}

Quat rotation_deg(const Vec3& axis, double degrees) noexcept {
  const SinCos half = sin_cos_deg(0.5 * degrees);
  return {half.cos, half.sin * axis.x(), half.sin * axis.y(), half.sin * axis.z()};
}

Quat turn_of_z(const Vec3& to) noexcept {
  const double twice_w = std::sqrt(2.0 * (1.0 + to.z()));
  if (!(twice_w > 1e-6)) return {0.0, 1.0, 0.0, 0.0};
  return {0.5 * twice_w, -to.y() / twice_w, to.x() / twice_w, 0.0};
}

}  // namespace subworld
