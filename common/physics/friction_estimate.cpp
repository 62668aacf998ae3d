#include "physics/friction_estimate.hpp"

#include "model/vectors.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr std::size_t kUsualContactPoints = 4096;
/// On dense heaps, more sweeps with rotation change the sums over a body by less than 0.02 %.
constexpr int kMostSweeps = 5, kLinearSweeps = 20;
/// Iterations end when one changes less than this share of all impulses.
constexpr double kSettled = 1e-3;

Eigen::Array4f padded(const Vec3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z()), 0.0F};
}

/// Projects a friction impulse onto the tangent plane and into the friction cone.
void project_to_cone(Contact& contact, double friction) {
  Vec3& impulse = contact.tangential_impulse;
  impulse -= impulse.dot(contact.normal) * contact.normal;
  impulse = shortened(impulse, friction * std::max(0.0, contact.normal_impulse));
}

}  // namespace

VelocityChange open_change(double mass, const Vec3& inertia, bool rotates, const BodyState& loaded) {
  VelocityChange change{.inverse_mass = 1.0 / mass,
                        .centre = loaded.position,
                        .linear = -loaded.linear_velocity,
                        .angular = -loaded.angular_velocity};
  if (rotates) {
    const Eigen::Matrix3d turn = loaded.orientation.toRotationMatrix();
    change.inverse_inertia = turn * inertia.cwiseInverse().asDiagonal() * turn.transpose();
  }
  return change;
}

void close(VelocityChange& change, const BodyState& after) {
  change.linear += after.linear_velocity;
  change.angular += after.angular_velocity;
}

FrictionEstimate::FrictionEstimate() { points_.reserve(kUsualContactPoints); }

FrictionEstimate::Point FrictionEstimate::point_of(const Contact& contact, const VelocityChange& a,
                                                   const VelocityChange& b, double friction) const {
  Point point;
  Eigen::Matrix<double, 3, 2> tangents;
  tangents.col(0) = contact.normal.unitOrthogonal();
  tangents.col(1) = contact.normal.cross(tangents.col(0));
  const double inverse_mass = a.inverse_mass + b.inverse_mass;
  Eigen::Matrix2d mobility = inverse_mass * Eigen::Matrix2d::Identity();
  Eigen::Matrix<double, 3, 2> arms_a, arms_b;
  for (int k = 0; k < 2; ++k) {
    arms_a.col(k) = (contact.point - a.centre).cross(tangents.col(k));
    arms_b.col(k) = (contact.point - b.centre).cross(tangents.col(k));
  }
  const Eigen::Matrix<double, 3, 2> turns_a = a.inverse_inertia * arms_a, turns_b = b.inverse_inertia * arms_b;
  mobility += arms_a.transpose() * turns_a + arms_b.transpose() * turns_b;
  for (int k = 0; k < 2; ++k) {
    point.rows[k] = {padded(tangents.col(k)), padded(arms_a.col(k)), padded(arms_b.col(k)), padded(turns_a.col(k)),
                     padded(turns_b.col(k))};
  }
  // Two immovable bodies give no information.
  point.inverse_mobility.setZero();
  if (mobility.determinant() > 0.0) point.inverse_mobility = mobility.inverse().cast<float>();
  point.effective_mass = inverse_mass > 0.0 ? static_cast<float>(1.0 / inverse_mass) : 0.0F;
  point.limit = static_cast<float>(friction * std::max(0.0, contact.normal_impulse));
  point.impulse = (tangents.transpose() * contact.tangential_impulse).cast<float>();
  point.a = index(contact.a);
  point.b = index(contact.b);
  point.inverse_mass_a = static_cast<float>(a.inverse_mass);
  point.inverse_mass_b = static_cast<float>(b.inverse_mass);
  return point;
}

template <bool kRotation>
void FrictionEstimate::sweep(int most) {
  for (int round = 0; round < most; ++round) {
    float changed = 0.0F, total = 0.0F;
    for (Point& point : points_) {
      if (point.limit <= 0.0F) continue;
      Unexplained& a = unexplained_[point.a];
      Unexplained& b = unexplained_[point.b];
      const auto across = [&](const Row& row) {
        Padded sum = row.tangent * (a.linear - b.linear);
        if constexpr (kRotation) sum += row.arm_a * a.angular - row.arm_b * b.angular;
        return sum.sum();
      };
      const Eigen::Vector2f velocity(across(point.rows[0]), across(point.rows[1]));
      Eigen::Vector2f wanted = point.impulse;
      if constexpr (kRotation) {
        wanted += point.inverse_mobility * velocity;
      } else {
        wanted += point.effective_mass * velocity;
      }
      const float squared = wanted.squaredNorm();
      if (squared > point.limit * point.limit) wanted *= point.limit / std::sqrt(squared);
      const Eigen::Vector2f more = wanted - point.impulse;
      point.impulse = wanted;
      const Padded impulse = more[0] * point.rows[0].tangent + more[1] * point.rows[1].tangent;
      a.linear -= point.inverse_mass_a * impulse;
      b.linear += point.inverse_mass_b * impulse;
      if constexpr (kRotation) {
        a.angular -= more[0] * point.rows[0].turn_a + more[1] * point.rows[1].turn_a;
        b.angular += more[0] * point.rows[0].turn_b + more[1] * point.rows[1].turn_b;
      }
      changed += more.squaredNorm();
      total += wanted.squaredNorm();
    }
    if (changed <= kSettled * kSettled * total) break;
  }
}

void FrictionEstimate::estimate(std::span<const VelocityChange> changes, std::span<const double> friction,
                                std::span<Contact> contacts) {
  left_.assign(changes.begin(), changes.end());
  points_.clear();
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    Contact& contact = contacts[i];
    project_to_cone(contact, friction[i]);
    VelocityChange& a = left_[index(contact.a)];
    VelocityChange& b = left_[index(contact.b)];
    const Vec3 known = contact.normal_impulse * contact.normal + contact.tangential_impulse;
    a.linear -= a.inverse_mass * known;
    a.angular -= a.inverse_inertia * (contact.point - a.centre).cross(known);
    b.linear += b.inverse_mass * known;
    b.angular += b.inverse_inertia * (contact.point - b.centre).cross(known);
    points_.push_back(point_of(contact, a, b, friction[i]));
  }
  unexplained_.clear();
  for (const VelocityChange& left : left_) unexplained_.push_back({padded(left.linear), padded(left.angular)});

  sweep<true>(kMostSweeps);
  sweep<false>(kLinearSweeps);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    Contact& contact = contacts[i];
    const Vec3 first = contact.normal.unitOrthogonal();
    const Eigen::Vector2d impulse = points_[i].impulse.cast<double>();
    contact.tangential_impulse = impulse[0] * first + impulse[1] * contact.normal.cross(first);
    project_to_cone(contact, friction[i]);  // rounding
  }
}

}  // namespace subworld
