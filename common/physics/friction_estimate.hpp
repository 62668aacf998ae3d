#pragma once

#include "model/body.hpp"
#include "model/contact.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace subworld {

/// What one engine step did to a body, for engines that do not tell their friction impulses.
struct VelocityChange {
  double inverse_mass = 0.0;                                  ///< 1/kg; 0: fixed, nothing is learnt from it
  Eigen::Matrix3d inverse_inertia = Eigen::Matrix3d::Zero();  ///< world frame, 1/(kg m^2); zero: does not turn
  Vec3 centre = Vec3::Zero();                                 ///< m
  Vec3 linear = Vec3::Zero();                                 ///< change less what forces gave it, m/s
  Vec3 angular = Vec3::Zero();                                ///< likewise, rad/s
};

/// The change since `loaded`: the state before a step, its velocity with what forces will add to it. Mass in kg,
/// principal moments in kg m^2; `rotates` false: it only translates. close() completes it.
[[nodiscard]] VelocityChange open_change(double mass, const Vec3& inertia, bool rotates, const BodyState& loaded);
void close(VelocityChange& change, const BodyState& after);

/// Friction impulses from the balance of momentum: what neither forces nor normal impulses explain of the bodies'
/// change of velocity is friction. Where many contacts share it the split is not unique; this is the least-squares
/// solution inside the cones (|t| <= mu n) that projected Gauss-Seidel reaches from where it begins. Where an engine's
/// own friction acts at other points than it reports, both balances cannot be met: then the linear one is. On dense
/// heaps the sums over a body are right to about 1 %; the parts of single contacts are an estimate.
class FrictionEstimate {
 public:
  FrictionEstimate();

  /// Writes `tangential_impulse` of each contact, N s, beginning from what is there. `changes` is indexed by body id;
  /// `friction` holds mu of each contact. Keeps nothing from one call to the next.
  void estimate(std::span<const VelocityChange> changes, std::span<const double> friction, std::span<Contact> contacts);

 private:
  /// Three numbers, and one that is zero: they fill a register of the processor.
  using Padded = Eigen::Array4f;
  /// An impulse along one tangent t of a contact, with arms r and inertias I of the two bodies.
  struct Row {
    Padded tangent;
    Padded arm_a, arm_b;    ///< r x t
    Padded turn_a, turn_b;  ///< I^-1 (r x t)
  };
  struct Point {
    Row rows[2];
    Eigen::Matrix2f inverse_mobility;
    float effective_mass;  ///< kg, of the pair without rotation; 0: both fixed
    float limit;           ///< N s
    Eigen::Vector2f impulse;
    std::uint32_t a, b;
    float inverse_mass_a, inverse_mass_b;
  };
  struct Unexplained {
    Padded linear, angular;
  };

  template <bool kRotation>
  void sweep(int most);
  [[nodiscard]] Point point_of(const Contact& contact, const VelocityChange& a, const VelocityChange& b,
                               double friction) const;

  std::vector<Point> points_;
  std::vector<VelocityChange> left_;      ///< by body id: less what normal impulses explain
  std::vector<Unexplained> unexplained_;  ///< by body id: less what friction explains as well
};

}  // namespace subworld
