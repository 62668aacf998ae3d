#pragma once

#include "model/types.hpp"

/// Analytical results for the cases of the stability lab. SI units; angles of slopes in degrees.
namespace subworld {

/// v^2 / (2 mu g): Coulomb friction stops a body that slides at v (m/s).
[[nodiscard]] double slide_distance_m(double speed_m_s, double mu);

/// A round body with I = k m r^2 that is thrown without spin at v0: it slides until v = v0 / (1 + k), after
/// t = k v0 / ((1 + k) mu g). k = 2/5: a ball; 1/2: a cylinder.
struct SlideToRoll {
  double speed_m_s = 0.0;
  double sliding_s = 0.0;
  double sliding_m = 0.0;
  /// Position at t >= sliding_s.
  [[nodiscard]] double place_m(double t_s) const { return sliding_m + speed_m_s * (t_s - sliding_s); }
};
[[nodiscard]] SlideToRoll slide_to_roll(double v0_m_s, double k, double mu);

/// atan(mu)
[[nodiscard]] double slip_angle_deg(double mu);
/// atan(w / h): a box of width w along the slope and height h tips, if it does not slip before.
[[nodiscard]] double tip_angle_deg(double width_over_height);

/// W / (2 sin(a)): normal force of each side of a V groove of half angle a on a body of weight W, without friction.
[[nodiscard]] double groove_force_n(double weight_n, double half_angle_deg);
/// r / sin(a): height of a ball's centre above the groove's bottom.
[[nodiscard]] double groove_height_m(double radius_m, double half_angle_deg);

/// 3 R w0 / (4 mu g): time until a disc that spins flat on a floor stops, with uniform pressure.
[[nodiscard]] double disc_spin_s(double rate_rad_s, double radius_m, double mu);

/// Period of the body-frame angular velocity of a free body: 4 K(k) sqrt(I1 I2 I3 / ((I3 - I2)(L^2 - 2 E I1))).
[[nodiscard]] double tumble_period_s(const Vec3& inertia, const Vec3& body_rate_rad_s);

/// Slow root W of m g l = W (I3 w3 - I1 W cos(theta)): steady precession of a top. I1 about the tip, w3 its total spin
/// about its own axis. Not a number if the top is too slow.
[[nodiscard]] double precession_rad_s(double weight_moment_n_m, double i1, double i3, double w3_rad_s,
                                      double theta_rad);

/// A free body by Euler's equations, integrated with classical Runge-Kutta steps of 0.1 ms or less.
struct FreeBody {
  Vec3 rate_rad_s = Vec3::Zero();  ///< body frame
  Quat orientation = Quat::Identity();
};
[[nodiscard]] FreeBody turned_by_euler(const Vec3& inertia, FreeBody body, double duration_s);

}  // namespace subworld
