#pragma once

#include "model/body.hpp"
#include "model/contact.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace subworld {

/// Change of a body's velocity in an engine step, for engines that do not report their friction impulses.
struct VelocityChange {
  double inverse_mass = 0.0;                                  ///< 1/kg; 0: fixed, gives no information
  Eigen::Matrix3d inverse_inertia = Eigen::Matrix3d::Zero();  ///< world frame, 1/(kg m^2); zero: does not rotate
  Vec3 centre = Vec3::Zero();                                 ///< m
  Vec3 linear = Vec3::Zero();                                 ///< change without the share of forces, m/s
  Vec3 angular = Vec3::Zero();                                ///< likewise, rad/s
};

/// Begins the change of a body. `loaded`: the state before a step, with the velocity that forces will add. Mass in kg,
/// principal moments in kg m^2; `rotates` false: it only translates. close() completes it.
[[nodiscard]] VelocityChange open_change(double mass, const Vec3& inertia, bool rotates, const BodyState& loaded);
void close(VelocityChange& change, const BodyState& after);

/// Friction impulses from the balance of momentum: the change of the bodies' velocity that neither forces nor normal
/// impulses explain is friction. If many contacts share it, the distribution is not unique. The result is the
/// least-squares solution inside the cones (|t| <= mu n) that projected Gauss-Seidel reaches from its start. If an
/// engine's own friction acts at other points than it reports, both balances cannot be satisfied: then only the linear
/// one is. On dense heaps the sums over a body are correct to about 1 %; the impulses of single contacts are an
/// estimate.
class FrictionEstimate {
 public:
  FrictionEstimate();

  /// Writes `tangential_impulse` of each contact, N s, starting from its present value. `changes` is indexed by body
  /// id; `friction` has mu of each contact. No state remains between calls.
  void estimate(std::span<const VelocityChange> changes, std::span<const double> friction, std::span<Contact> contacts);

 private:
  /// Three numbers and a zero, which fill a register of the processor.
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
  std::vector<VelocityChange> left_;      ///< by body id: velocity change that normal impulses do not explain
  std::vector<Unexplained> unexplained_;  ///< by body id: change that friction does not explain either
};

}  // namespace subworld
