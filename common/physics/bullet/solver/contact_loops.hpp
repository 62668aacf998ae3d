#pragma once

#include "physics/bullet/solver/contact_batches.hpp"

namespace subworld::bullet {

/// Speeds (m/s) along the normal of a bounce whose flight has the height that Newton's restitution e gives. Bodies
/// advance v by f, then x by v h (f: by forces, h: a small step, d: gap). Such points lie on a parabola that has the
/// speed v - f / 2 before the step, v being the speed after the forces.
///   met at the touch:                            c^2 = (v - f / 2)^2 - 2 f d / h              (4)
///   left at gap d, before the next small step:   (u + f / 2)^2 = e^2 c^2 + 2 f d / h          (5)
inline btScalar touch_speed(btScalar speed, btScalar by_force, btScalar gap, btScalar h) {
  const btScalar behind = speed - by_force / 2;
  return behind < 0 ? btSqrt(btMax(behind * behind - 2 * by_force * gap / h, btScalar(0))) : btScalar(0);
}
inline btScalar bounce_speed(btScalar bounce, btScalar by_force, btScalar gap, btScalar h) {
  return btSqrt(btMax(bounce * bounce + 2 * by_force * gap / h, btScalar(0))) - by_force / 2;
}

/// The loops over batches, each compiled for two kinds of processors. Only contact_batches.cpp includes them.
struct ContactBatches::Loops {
  /// (1), of all three axes.
  SUBWORLD_WIDE static Wide3 speed(const Point& p, const WideMotion& m) {
    return (m.linear_a + cross(m.angular_a, p.arm_a)) - (m.linear_b + cross(m.angular_b, p.arm_b));
  }
  /// (2), of an impulse along any axis.
  SUBWORLD_WIDE static void apply(const Batch& batch, const Point& p, const Wide3& impulse, WideMotion& m) {
    m.linear_a = m.linear_a + batch.inverse_mass_a * impulse;
    m.angular_a = m.angular_a + batch.inverse_inertia_a * cross(p.arm_a, impulse);
    m.linear_b = m.linear_b - batch.inverse_mass_b * impulse;
    m.angular_b = m.angular_b - batch.inverse_inertia_b * cross(p.arm_b, impulse);
  }
  /// (3) along an axis, and its part across to another one.
  SUBWORLD_WIDE static Wide inverse_mass(const Batch& batch, const Point& p, const Wide3& n) {
    return batch.inverse_mass_a + batch.inverse_mass_b + across(batch, p, n, n);
  }
  SUBWORLD_WIDE static Wide across(const Batch& batch, const Point& p, const Wide3& n, const Wide3& other) {
    return dot(cross(p.arm_a, other), batch.inverse_inertia_a * cross(p.arm_a, n)) +
           dot(cross(p.arm_b, other), batch.inverse_inertia_b * cross(p.arm_b, n));
  }

  // Each of these functions is called for some of the batches.

  SUBWORLD_WIDE static void find_steps(std::span<const Batch> batches, Point* points) {
    for (const Batch& batch : batches) {
      for (std::uint32_t i = batch.begin; i < batch.end; ++i) {
        Point& p = points[i];
        const Wide zero{};
        const Wide k = inverse_mass(batch, p, p.normal);
        p.step = k > zero ? 1 / k : zero;
        const Wide3 second = cross(p.normal, p.side);
        const Wide k1 = inverse_mass(batch, p, p.side), k2 = inverse_mass(batch, p, second);
        const Wide off = across(batch, p, p.side, second), half = (k1 - k2) / 2;
        const Wide both = (k1 + k2) / 2 + root_of(half * half + off * off);
        p.side_step = both > zero ? 1 / both : zero;
      }
    }
  }

  SUBWORLD_WIDE static void start(const ContactBatches& all, std::span<const Batch> batches, btScalar h, Point* points,
                                  std::span<Motion> motions) {
    for (const Batch& batch : batches) {
      WideMotion m = load(motions, batch.a, batch.b);
      for (std::uint32_t i = batch.begin; i < batch.end; ++i) {
        Point& p = points[i];
        if (batch.restitutes) meet(all, batch, dot(p.normal, speed(p, m)), h, p);
        Wide3 impulse = p.impulse * p.normal;
        if (batch.rubs) impulse = impulse + p.side_impulse[0] * p.side + p.side_impulse[1] * cross(p.normal, p.side);
        apply(batch, p, impulse, m);
      }
      store(m, batch.a, batch.b, motions);
    }
  }
  static void meet(const ContactBatches& all, const Batch& batch, const Wide& speeds, btScalar h, Point& p) {
    for (std::size_t l = 0; l < batch.pairs; ++l) {
      if (all.pairs_[batch.first + l].restitution != 0 && p.total[l] == 0)
        p.met[l] = touch_speed(speeds[l], p.by_force[l], p.gap[l], h);
    }
  }

  SUBWORLD_WIDE static void rub(const Batch& batch, Point& p, WideMotion& m) {
    const Wide most = batch.friction * p.impulse;
    const Wide3 u = speed(p, m), axis = cross(p.normal, p.side);
    Wide speed_1 = dot(u, p.side), speed_2 = dot(u, axis);
    if (batch.slides) speed_1 += p.slide[0], speed_2 += p.slide[1];
    // The impulses that would stop the motion.
    Wide first = p.side_impulse[0] - speed_1 * p.side_step, second = p.side_impulse[1] - speed_2 * p.side_step;
    const Wide square = first * first + second * second;
    const Wide one = Wide{} + 1;
    const Wide share = square > most * most ? most / root_of(square) : one;
    first *= share;
    second *= share;
    apply(batch, p, (first - p.side_impulse[0]) * p.side + (second - p.side_impulse[1]) * axis, m);
    p.side_impulse[0] = first;
    p.side_impulse[1] = second;
  }

  /// Returns the changes of velocity, m/s.
  SUBWORLD_WIDE static Wide press(const Batch& batch, const ContactSpring& spring, btScalar h, Point& p,
                                  WideMotion& m) {
    const Wide zero{};
    const Wide stop = -p.step * dot(p.normal, speed(p, m));
    Wide by = stop - most_of(p.gap, zero) * p.step / h;  // a gap may close
    if (spring.bias_rate > 0) {
      const Wide depth = -p.gap - batch.noise;
      const Wide push = spring.mass_scale * spring.bias_rate * depth * p.step - spring.impulse_scale * p.impulse;
      by = depth > zero ? spring.mass_scale * stop + least_of(push, spring.fastest * p.step) : by;
    }
    by = most_of(by, -p.impulse);
    p.impulse += by;
    apply(batch, p, by * p.normal, m);
    return p.step > zero ? size_of(by) / p.step : zero;
  }

  static void turn(ContactBatches& all, const Batch& batch, std::span<Motion> motions) {
    for (std::size_t l = 0; l < batch.pairs; ++l) {
      const Pair& pair = all.pairs_[batch.first + l];
      btScalar pressed = 0;
      for (std::uint32_t i = batch.begin; i < batch.end; ++i) pressed += all.points_[i].impulse[l];
      BothMotion motion = bullet::gather(motions[pair.a], motions[pair.b]);
      all.turning_.solve(pair, pressed, motion);
      bullet::scatter(motion, motions[pair.a], motions[pair.b]);
    }
  }

  SUBWORLD_WIDE static bool solve(ContactBatches& all, std::span<const Batch> batches, const ContactSpring& spring,
                                  btScalar h, btScalar enough, std::span<const std::uint8_t> busy,
                                  std::span<std::uint8_t> changed, std::span<Motion> motions) {
    const auto is_busy = [&](const Batch& batch) {
      std::uint8_t any = 0;
      for (std::size_t l = 0; l < kLanes; ++l)
        any = static_cast<std::uint8_t>(any | busy[batch.a[l]] | busy[batch.b[l]]);
      return any != 0;
    };
    bool any = false;
    for (const Batch& batch : batches) {
      if (!busy.empty() && !is_busy(batch)) continue;
      const std::span points = std::span(all.points_).subspan(batch.begin, batch.end - batch.begin);
      WideMotion m = load(motions, batch.a, batch.b);
      if (batch.rubs) {
        for (Point& p : points) rub(batch, p, m);
      }
      if (batch.turns) {
        store(m, batch.a, batch.b, motions);
        turn(all, batch, motions);
        m = load(motions, batch.a, batch.b);
      }
      Wide change{};
      for (Point& p : points) change = most_of(change, press(batch, spring, h, p, m));
      store(m, batch.a, batch.b, motions);
      for (std::size_t l = 0; l < batch.pairs; ++l) {
        if (change[l] <= enough) continue;
        any = true;
        for (const std::uint32_t mover : {batch.a[l], batch.b[l]}) {
          if (mover != kFixed) changed[mover] = 1;
        }
      }
    }
    return any;
  }

  SUBWORLD_WIDE static void follow(std::span<const Batch> batches, Point* points, std::span<const Motion> moved) {
    for (const Batch& batch : batches) {
      const WideMotion m = load(moved, batch.a, batch.b);
      for (std::uint32_t i = batch.begin; i < batch.end; ++i)
        points[i].gap = points[i].start + dot(points[i].normal, speed(points[i], m));
    }
  }

#ifdef __x86_64__
#define SUBWORLD_AVX2 [[gnu::target("avx2")]]
#else
#define SUBWORLD_AVX2
#endif
  SUBWORLD_AVX2 static void find_steps_avx2(std::span<const Batch> batches, Point* points) {
    find_steps(batches, points);
  }
  SUBWORLD_AVX2 static void start_avx2(const ContactBatches& all, std::span<const Batch> batches, btScalar h,
                                       Point* points, std::span<Motion> motions) {
    start(all, batches, h, points, motions);
  }
  SUBWORLD_AVX2 static bool solve_avx2(ContactBatches& all, std::span<const Batch> batches, const ContactSpring& spring,
                                       btScalar h, btScalar enough, std::span<const std::uint8_t> busy,
                                       std::span<std::uint8_t> changed, std::span<Motion> motions) {
    return solve(all, batches, spring, h, enough, busy, changed, motions);
  }
  SUBWORLD_AVX2 static void follow_avx2(std::span<const Batch> batches, Point* points, std::span<const Motion> moved) {
    follow(batches, points, moved);
  }
};

}  // namespace subworld::bullet
