#include "physics/friction_estimate.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr std::size_t kUsualContacts = 4096;
constexpr int kMostSweeps = 30, kLinearSweeps = 20;
/// A sweep that changes less than this part of all impulses is the last.
constexpr double kSettled = 1e-3;

/// Velocity at `arm` of an impulse of 1 N s there, per direction.
Eigen::Matrix3d mobility(const VelocityChange& body, const Vec3& arm) {
  Eigen::Matrix3d cross;
  cross << 0.0, -arm.z(), arm.y(), arm.z(), 0.0, -arm.x(), -arm.y(), arm.x(), 0.0;
  return body.inverse_mass * Eigen::Matrix3d::Identity() - cross * body.inverse_inertia * cross;
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

FrictionEstimate::FrictionEstimate() {
  points_.reserve(kUsualContacts);
  unexplained_.reserve(kUsualContacts);
}

void FrictionEstimate::take(const Point& point, const Contact& contact, const Vec3& impulse) {
  Unexplained& a = unexplained_[index(contact.a)];
  a.linear -= point.a->inverse_mass * impulse;
  a.angular -= point.a->inverse_inertia * point.arm_a.cross(impulse);
  Unexplained& b = unexplained_[index(contact.b)];
  b.linear += point.b->inverse_mass * impulse;
  b.angular += point.b->inverse_inertia * point.arm_b.cross(impulse);
}

void FrictionEstimate::sweep(std::span<const Contact> contacts, int most, bool rotation) {
  for (int round = 0; round < most; ++round) {
    double changed = 0.0;
    double total = 0.0;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      Point& point = points_[i];
      if (point.limit <= 0.0) continue;
      const Unexplained& a = unexplained_[index(contacts[i].a)];
      const Unexplained& b = unexplained_[index(contacts[i].b)];
      const Vec3 velocity =
          rotation ? Vec3(a.linear + a.angular.cross(point.arm_a) - b.linear - b.angular.cross(point.arm_b))
                   : Vec3(a.linear - b.linear);
      const Eigen::Vector2d across = point.tangents.transpose() * velocity;
      Eigen::Vector2d wanted = point.impulse + (rotation ? Eigen::Vector2d(point.inverse_mobility * across)
                                                         : Eigen::Vector2d(point.effective_mass * across));
      if (const double size = wanted.norm(); size > point.limit) wanted *= point.limit / size;
      const Eigen::Vector2d more = wanted - point.impulse;
      point.impulse = wanted;
      take(point, contacts[i], point.tangents * more);
      changed += more.squaredNorm();
      total += wanted.squaredNorm();
    }
    if (changed <= kSettled * kSettled * total) break;
  }
}

void FrictionEstimate::estimate(std::span<const VelocityChange> changes, std::span<const double> friction,
                                std::span<Contact> contacts) {
  unexplained_.clear();
  for (const VelocityChange& change : changes) unexplained_.push_back({change.linear, change.angular});
  points_.clear();
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    Contact& contact = contacts[i];
    Point point{.a = &changes[index(contact.a)],
                .b = &changes[index(contact.b)],
                .arm_a = contact.point - changes[index(contact.a)].centre,
                .arm_b = contact.point - changes[index(contact.b)].centre,
                .tangents = {},
                .inverse_mobility = Eigen::Matrix2d::Zero(),
                .effective_mass = 0.0,
                .limit = friction[i] * std::max(0.0, contact.normal_impulse),
                .impulse = Eigen::Vector2d::Zero()};
    point.tangents.col(0) = contact.normal.unitOrthogonal();
    point.tangents.col(1) = contact.normal.cross(point.tangents.col(0));
    const Eigen::Matrix2d k = point.tangents.transpose() *
                              (mobility(*point.a, point.arm_a) + mobility(*point.b, point.arm_b)) * point.tangents;
    // Two bodies that nothing moves leave nothing to learn.
    if (k.determinant() > 0.0) point.inverse_mobility = k.inverse();
    const double inverse_mass = point.a->inverse_mass + point.b->inverse_mass;
    if (inverse_mass > 0.0) point.effective_mass = 1.0 / inverse_mass;
    take(point, contact, contact.normal_impulse * contact.normal);
    points_.push_back(point);
  }

  sweep(contacts, kMostSweeps, true);
  sweep(contacts, kLinearSweeps, false);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    contacts[i].tangential_impulse = points_[i].tangents * points_[i].impulse;
  }
}

}  // namespace subworld
