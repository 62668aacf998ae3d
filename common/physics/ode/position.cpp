#include "position.hpp"

#include <algorithm>

namespace subworld::ode {

namespace {

constexpr double kPartPerStep = 0.2;
constexpr double kNegligible = 1e-9;  ///< m

}  // namespace

void PositionCorrection::clear(std::size_t count) {
  movers_.assign(count, Mover{});
  rows_.clear();
  deepest_ = 0.0;
}

void PositionCorrection::add(std::uint32_t a, std::uint32_t b, const Vec3& arm_a, const Vec3& arm_b, const Vec3& normal,
                             double distance) {
  Row row{a, b, normal, arm_a.cross(normal), arm_b.cross(normal), {}, {}, 0.0, 0.0};
  row.turn_a = movers_[a].inverse_inertia * row.arm_a_cross_n;
  row.turn_b = movers_[b].inverse_inertia * row.arm_b_cross_n;
  row.mobility = movers_[a].inverse_mass + movers_[b].inverse_mass + row.arm_a_cross_n.dot(row.turn_a) +
                 row.arm_b_cross_n.dot(row.turn_b);
  row.wanted = distance < 0.0 ? -kPartPerStep * distance : -distance;
  if (row.mobility <= 0.0) return;
  deepest_ = std::max(deepest_, -distance);
  rows_.push_back(row);
}

bool PositionCorrection::solve(int iterations) {
  if (deepest_ < kNegligible) return false;
  for (int i = 0; i < iterations; ++i) {
    for (Row& row : rows_) {
      Mover& a = movers_[row.a];
      Mover& b = movers_[row.b];
      const double moved =
          row.normal.dot(a.shift - b.shift) + row.arm_a_cross_n.dot(a.turn) - row.arm_b_cross_n.dot(b.turn);
      const double push = std::max(0.0, row.push + (row.wanted - moved) / row.mobility);
      const double change = push - row.push;
      row.push = push;
      a.shift += change * a.inverse_mass * row.normal;
      b.shift -= change * b.inverse_mass * row.normal;
      a.turn += change * row.turn_a;
      b.turn -= change * row.turn_b;
    }
  }
  return true;
}

}  // namespace subworld::ode
