#pragma once

#include "physics/bullet/contacts/contact_points.hpp"
#include "physics/bullet/movers.hpp"
#include "physics/bullet/solver/turning_friction.hpp"
#include "physics/bullet/solver/wide.hpp"
#include "physics/workers.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace subworld::bullet {

/// A contact as a damped spring, implicit in a small step. With w = 2 pi f, damping ratio z and length h:
///   s = 2 z + h w,  bias rate w / s,  c = h w s,  mass scale c / (1 + c),  impulse scale 1 / (1 + c)
/// (Catto 2011, "Soft constraints"). The stiffness is the largest that the pair's effective mass permits.
struct ContactSpring {
  btScalar bias_rate = 0;      ///< of the penetration, 1/s; 0: the contact is rigid
  btScalar mass_scale = 1;     ///< factor of the impulse that would stop the motion
  btScalar impulse_scale = 0;  ///< share of the impulse so far that is removed
  btScalar fastest = 0;        ///< speed limit for removing penetration, m/s
};

/// The contacts of small steps, for several pairs of bodies at a time. The pairs of a batch have no movable body in
/// common, so that they are independent: pairs are coloured, first fit, and a batch has pairs of one colour (Catto
/// 2024, "SIMD matters").
///
/// A point has arms r from the centres of both bodies, a and b. With v, w, m and I of each body, and all terms of b
/// negative:
///   the speed along an axis n      u = n (v + w x r)                      (1)
///   an impulse p n changes         v by n p / m,  w by I^-1 (r x n) p     (2)
///   the inverse of its mass        k = 1/m + n ((I^-1 (r x n)) x r), both terms positive   (3)
class ContactBatches {
 public:
  struct Pair : ContactPair {
    btScalar restitution = 0;
  };

  /// Whether this processor has instructions (AVX2) for vectors of 32 bytes. Results are equal without.
  [[nodiscard]] static bool has_long_vectors() noexcept;

  /// `workers` must outlive this object.
  explicit ContactBatches(Workers& workers, bool long_vectors = has_long_vectors());

  /// `rub_all`: contacts without friction get friction rows too.
  void prepare(std::span<btPersistentManifold* const> manifolds, std::span<const Mover> movers, bool rub_all);
  /// A mover has another mass and inertia from now on.
  void set_inertia(std::uint32_t mover, std::span<const Mover> movers);
  /// Applies the impulses of the previous small step. `h`: length of a small step, s.
  void start(btScalar h, std::span<Motion> motions);
  /// One pass over the pairs with a `busy` mover; over all if there are none. Marks the movers of pairs that changed a
  /// velocity by more than `enough` (m/s) as `changed`, and returns whether there are any.
  bool solve(const ContactSpring& spring, btScalar h, btScalar enough, std::span<const std::uint8_t> busy,
             std::span<std::uint8_t> changed, std::span<Motion> motions);
  /// Finds the gaps after the bodies have moved, m and rad.
  void follow(std::span<const Motion> moved);
  /// Adds the impulses of this small step to those of the step.
  void add_up();

  [[nodiscard]] std::span<const Pair> pairs() const noexcept { return pairs_; }
  /// Whether the pair has restitution and hit with at least `threshold`, m/s.
  [[nodiscard]] bool bounces(std::size_t pair, btScalar threshold) const;
  /// Newton's restitution of the pair, times `factor`. Returns the largest change of a velocity, m/s.
  btScalar bounce(std::size_t pair, btScalar factor, btScalar threshold, btScalar h, std::span<Motion> motions);
  /// Remembers the impulses, and returns to them.
  void save() { saved_ = points_; }
  void revert() { points_ = saved_; }

  void write_impulses();

 private:
  /// Impulses are those of one small step.
  struct Point {
    Wide3 normal;        ///< from b to a
    Wide3 side;          ///< a direction of friction; the other one is normal x side
    Wide3 arm_a, arm_b;  ///< m
    Wide step;           ///< 1 / k along the normal, kg
    Wide side_step;      ///< likewise of both directions of friction (friction_step)
    Wide impulse, side_impulse[2];
    Wide start, gap;              ///< before the step, and now, m
    Wide total, side_total[2];    ///< of all small steps so far, N s
    Wide slide[2];                ///< speed of the surfaces beside the motion, m/s
    Wide met, by_force, bounced;  ///< with restitution: speed (m/s) of approach at the first touch; its change
                                  ///< by forces in a small step; 1: bounced
  };
  /// Pairs `first`, `first` + 1, ... in the lanes.
  struct Batch {
    Lanes a, b;  ///< movers; kFixed in lanes without a pair
    Wide inverse_mass_a, inverse_mass_b;
    WideSymmetric inverse_inertia_a, inverse_inertia_b;
    Wide friction;
    Wide noise;  ///< rounding of the gaps, m
    std::uint32_t first, pairs;
    std::uint32_t begin, end;  ///< of the points
    bool rubs, turns, slides, restitutes;
  };
  /// What is compiled for each kind of processor.
  struct Loops;

  void list_pairs(std::span<btPersistentManifold* const> manifolds, std::span<const Mover> movers, bool rub_all);
  void cut_batches();
  /// Calls `part` for parts of the batches, in any order.
  template <class Part>
  void for_any(const Part& part);
  /// The same for the batches of each colour after those of the colour before.
  template <class Part>
  void for_colours(const Part& part);
  /// Finds where the points of each batch are. Returns their number.
  std::uint32_t place_points(std::span<const Mover> movers);
  void fill(Batch& batch, std::span<const Mover> movers);
  void fill_point(const Batch& batch, std::size_t lane, const btManifoldPoint& point, Point& p) const;
  void put_inertia(Batch& batch, std::size_t lane, std::span<const Mover> movers);
  void find_steps(std::span<const Batch> batches);
  void write_impulses(const Batch& batch, std::size_t lane);
  void fill_bounce(const Batch& batch, std::span<const Mover> movers);

  static constexpr std::size_t kGrain = 16;  ///< batches, some microseconds

  Workers& workers_;
  bool long_vectors_;
  std::vector<Pair> pairs_, listed_;
  std::vector<std::uint64_t> used_;       ///< colours, by mover
  std::vector<std::uint32_t> colour_of_;  ///< by listed_
  std::vector<std::uint32_t> colour_begin_;
  std::vector<std::uint32_t> colours_;  ///< first batch of each colour that has some, and the end
  std::vector<Batch> batches_;
  std::vector<std::uint32_t> batch_of_;  ///< by pair
  std::vector<Point> points_, saved_;
  TurningFriction turning_;
};

}  // namespace subworld::bullet
