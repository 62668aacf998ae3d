#include "friction.hpp"

#include "model/sorted.hpp"

#include <tuple>

namespace subworld::ode {

namespace {

Vec3 vector(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }
std::array<double, 3> numbers(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

void FrictionMemory::remember(std::uint32_t a, std::uint32_t b, std::span<const At> points) {
  const auto count = static_cast<double>(points.size());
  Vec3 centre = Vec3::Zero(), mean = Vec3::Zero(), turn = Vec3::Zero();
  for (const At& at : points) centre += at.point / count;
  double arms = 0.0;
  for (const At& at : points) {
    const Vec3 friction = at.impulse - at.impulse.dot(at.normal) * at.normal;
    const Vec3 arm = at.point - centre;
    mean += friction / count;
    turn += arm.cross(friction);
    arms += arm.squaredNorm();
  }
  const Vec3 spin = arms > 0.0 ? Vec3(turn / arms) : Vec3::Zero();
  held_.push_back({a, b, numbers(centre), numbers(mean), numbers(spin)});
}

void FrictionMemory::forget(std::uint32_t body) {
  std::erase_if(held_, [&](const Friction& f) { return f.a == body || f.b == body; });
}

Vec3 FrictionMemory::recall(std::uint32_t a, std::uint32_t b, const Vec3& point) const {
  const auto f = find_sorted(held_, std::tuple(a, b), [](const Friction& held) { return std::tuple(held.a, held.b); });
  if (f == held_.end()) return Vec3::Zero();
  return vector(f->mean) + vector(f->spin).cross(point - vector(f->centre));
}

}  // namespace subworld::ode
