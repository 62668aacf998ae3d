#include "physics/bullet/solver/contact_loops.hpp"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>

namespace subworld::bullet {

namespace {

/// Contacts with fixed bodies have the last colours. Solved before others, a heavy cube of 10 kg on one of 1 kg
/// trembles by 5 mrad/s in single precision.
constexpr std::uint32_t kMovableColours = 48, kColours = 64;
/// Where there are too few colours, pairs are alone in their batches.
bool is_last(std::uint32_t colour) { return colour == kMovableColours - 1 || colour == kColours - 1; }

/// Rounding of a gap, relative to the coordinates from which it is computed. Without this tolerance, a card house of
/// seven stages in single precision creeps by 0.4 mm/s and falls after 20 s.
constexpr auto kPlaceRounding = 16 * SIMD_EPSILON;

void put(const btVector3& from, std::size_t lane, Wide3& to) {
  to.x[lane] = from.x(), to.y[lane] = from.y(), to.z[lane] = from.z();
}
void put(const btMatrix3x3& from, std::size_t lane, WideSymmetric& to) {
  to.xx[lane] = from[0][0], to.xy[lane] = from[0][1], to.xz[lane] = from[0][2];
  to.yy[lane] = from[1][1], to.yz[lane] = from[1][2], to.zz[lane] = from[2][2];
}
btVector3 lane_of(const Wide3& v, std::size_t lane) { return {v.x[lane], v.y[lane], v.z[lane]}; }

}  // namespace

bool ContactBatches::has_long_vectors() noexcept {
#ifdef __x86_64__
  return __builtin_cpu_supports("avx2");
#else
  return false;
#endif
}

ContactBatches::ContactBatches(Workers& workers, bool long_vectors) : workers_(workers), long_vectors_(long_vectors) {
  pairs_.reserve(kUsualPairs);
  listed_.reserve(kUsualPairs);
  colour_of_.reserve(kUsualPairs);
  batch_of_.reserve(kUsualPairs);
  used_.reserve(kUsualBodies);
  batches_.reserve(kUsualPairs);
  points_.reserve(kUsualPoints);
}

void ContactBatches::prepare(std::span<btPersistentManifold* const> manifolds, std::span<const Mover> movers,
                             bool rub_all) {
  list_pairs(manifolds, movers, rub_all);
  cut_batches();
  turning_.clear();
  points_.resize(place_points(movers));
  for_any([&](std::span<Batch> batches) {
    for (Batch& batch : batches) fill(batch, movers);
    find_steps(batches);
  });
}

template <class Part>
void ContactBatches::for_any(const Part& part) {
  workers_.run(batches_.size(), kGrain,
               [&](std::size_t begin, std::size_t end) { part(std::span(batches_).subspan(begin, end - begin)); });
}

template <class Part>
void ContactBatches::for_colours(const Part& part) {
  for (std::size_t c = 0; c + 1 < colours_.size(); ++c) {
    const std::span colour = std::span(batches_).subspan(colours_[c], colours_[c + 1] - colours_[c]);
    workers_.run(colour.size(), kGrain,
                 [&](std::size_t begin, std::size_t end) { part(colour.subspan(begin, end - begin)); });
  }
}

void ContactBatches::find_steps(std::span<const Batch> batches) {
  long_vectors_ ? Loops::find_steps_avx2(batches, points_.data()) : Loops::find_steps(batches, points_.data());
}

void ContactBatches::put_inertia(Batch& batch, std::size_t l, std::span<const Mover> movers) {
  const Pair& pair = pairs_[batch.first + l];
  const Mover &a = movers[pair.a], &b = movers[pair.b];
  batch.inverse_mass_a[l] = a.inverse_mass;
  batch.inverse_mass_b[l] = b.inverse_mass;
  put(a.inverse_inertia, l, batch.inverse_inertia_a);
  put(b.inverse_inertia, l, batch.inverse_inertia_b);
}

void ContactBatches::list_pairs(std::span<btPersistentManifold* const> manifolds, std::span<const Mover> movers,
                                bool rub_all) {
  listed_.clear();
  colour_of_.clear();
  used_.assign(movers.size(), 0);
  colour_begin_.assign(kColours + 1, 0);
  for (btPersistentManifold* manifold : manifolds) {
    if (manifold->getNumContacts() == 0) continue;
    Pair pair{make_pair_of(*manifold, movers, 0, rub_all)};
    if (pair.a == kFixed && pair.b == kFixed) continue;
    pair.restitution = manifold->getContactPoint(0).m_combinedRestitution;
    listed_.push_back(pair);
    const bool fixed = pair.a == kFixed || pair.b == kFixed;
    const std::uint32_t first = fixed ? kMovableColours : 0, last = (fixed ? kColours : kMovableColours) - 1;
    const auto taken = static_cast<std::uint32_t>(std::countr_one((used_[pair.a] | used_[pair.b]) >> first));
    const std::uint32_t colour = std::min(first + taken, last);
    for (const std::uint32_t mover : {pair.a, pair.b}) {
      if (mover != kFixed) used_[mover] |= std::uint64_t{1} << colour;
    }
    colour_of_.push_back(colour);
    ++colour_begin_[colour + 1];
  }
}

void ContactBatches::cut_batches() {
  for (std::size_t c = 0; c < kColours; ++c) colour_begin_[c + 1] += colour_begin_[c];
  pairs_.resize(listed_.size());
  for (std::size_t i = 0; i < listed_.size(); ++i) pairs_[colour_begin_[colour_of_[i]]++] = listed_[i];
  batches_.clear();
  batch_of_.clear();
  colours_.clear();
  std::size_t at = 0;
  for (std::uint32_t c = 0; c < kColours; ++c) {  // now each colour begins where the last one ended
    const std::size_t end = colour_begin_[c];
    if (at < end) colours_.push_back(static_cast<std::uint32_t>(batches_.size()));
    while (at < end) {
      Batch& batch = batches_.emplace_back();
      batch.first = static_cast<std::uint32_t>(at);
      batch.pairs = static_cast<std::uint32_t>(is_last(c) ? 1 : std::min(kLanes, end - at));
      at += batch.pairs;
      batch_of_.resize(at, static_cast<std::uint32_t>(batches_.size() - 1));
      if (is_last(c) && at < end) colours_.push_back(static_cast<std::uint32_t>(batches_.size()));
    }
  }
  colours_.push_back(static_cast<std::uint32_t>(batches_.size()));
}

std::uint32_t ContactBatches::place_points(std::span<const Mover> movers) {
  std::uint32_t count = 0;
  for (Batch& batch : batches_) {
    batch.begin = batch.end = count;
    for (std::size_t l = 0; l < batch.pairs; ++l) {
      Pair& pair = pairs_[batch.first + l];
      pair.begin = batch.begin;
      pair.end = batch.begin + static_cast<std::uint32_t>(pair.manifold->getNumContacts());
      batch.end = std::max(batch.end, pair.end);
      const btCollisionObject &first = *pair.manifold->getBody0(), &second = *pair.manifold->getBody1();
      if (surface_of(first) == nullptr && surface_of(second) == nullptr) continue;
      batch.slides = true;
      turning_.add(pair, inertia_of(movers[pair.a], movers[pair.b]), BothMotion{});
      batch.turns = batch.turns || pair.turning >= 0;
    }
    count = batch.end;
  }
  return count;
}

void ContactBatches::fill(Batch& batch, std::span<const Mover> movers) {
  batch.a.fill(kFixed);
  batch.b.fill(kFixed);
  std::fill(points_.begin() + batch.begin, points_.begin() + batch.end, Point{});
  for (std::size_t l = 0; l < batch.pairs; ++l) {
    const Pair& pair = pairs_[batch.first + l];
    batch.a[l] = pair.a;
    batch.b[l] = pair.b;
    put_inertia(batch, l, movers);
    batch.friction[l] = pair.friction;
    batch.rubs = batch.rubs || pair.rubs;
    batch.restitutes = batch.restitutes || pair.restitution != 0;
    for (std::uint32_t i = pair.begin; i < pair.end; ++i) {
      const btManifoldPoint& point = pair.manifold->getContactPoint(static_cast<int>(i - pair.begin));
      fill_point(batch, l, point, points_[i]);
      const btVector3 place = point.getPositionWorldOnB().absolute();
      batch.noise[l] = btMax(batch.noise[l], kPlaceRounding * place[place.maxAxis()]);
    }
  }
  if (batch.restitutes) fill_bounce(batch, movers);
}

void ContactBatches::fill_point(const Batch& batch, std::size_t l, const btManifoldPoint& point, Point& p) const {
  const Pair& pair = pairs_[batch.first + l];
  const btPersistentManifold& manifold = *pair.manifold;
  put(point.m_normalWorldOnB, l, p.normal);
  put(point.m_lateralFrictionDir1, l, p.side);
  put(point.getPositionWorldOnA() - manifold.getBody0()->getWorldTransform().getOrigin(), l, p.arm_a);
  put(point.getPositionWorldOnB() - manifold.getBody1()->getWorldTransform().getOrigin(), l, p.arm_b);
  p.start[l] = p.gap[l] = point.getDistance();
  const LastPart last = last_part_of(point);
  p.impulse[l] = last.normal;
  if (!pair.rubs) return;
  p.side_impulse[0][l] = last.lateral_1;
  p.side_impulse[1][l] = last.lateral_2;
  const btVector3 surfaces = sliding(manifold, point.getPositionWorldOnB());
  p.slide[0][l] = surfaces.dot(point.m_lateralFrictionDir1);
  p.slide[1][l] = surfaces.dot(point.m_lateralFrictionDir2);
}

void ContactBatches::fill_bounce(const Batch& batch, std::span<const Mover> movers) {
  for (std::size_t l = 0; l < batch.pairs; ++l) {
    const Pair& pair = pairs_[batch.first + l];
    const Mover &a = movers[pair.a], &b = movers[pair.b];
    for (std::uint32_t i = pair.begin; i < pair.end; ++i) {
      Point& p = points_[i];
      const btVector3 by_forces =
          a.by_force + a.by_torque.cross(lane_of(p.arm_a, l)) - b.by_force - b.by_torque.cross(lane_of(p.arm_b, l));
      p.by_force[l] = by_forces.dot(lane_of(p.normal, l));
    }
  }
}

void ContactBatches::set_inertia(std::uint32_t mover, std::span<const Mover> movers) {
  for (Batch& batch : batches_) {
    bool has = false;
    for (std::size_t l = 0; l < batch.pairs; ++l) {
      Pair& pair = pairs_[batch.first + l];
      if (pair.a != mover && pair.b != mover) continue;
      put_inertia(batch, l, movers);
      if (pair.turning >= 0) turning_.add(pair, inertia_of(movers[pair.a], movers[pair.b]), BothMotion{});
      has = true;
    }
    if (has) find_steps({&batch, 1});
  }
}

void ContactBatches::start(btScalar h, std::span<Motion> motions) {
  turning_.start();
  for_colours([&](std::span<const Batch> batches) {
    long_vectors_ ? Loops::start_avx2(*this, batches, h, points_.data(), motions)
                  : Loops::start(*this, batches, h, points_.data(), motions);
  });
}

bool ContactBatches::solve(const ContactSpring& spring, btScalar h, btScalar enough, std::span<const std::uint8_t> busy,
                           std::span<std::uint8_t> changed, std::span<Motion> motions) {
  std::atomic<bool> any = false;
  for_colours([&](std::span<const Batch> batches) {
    if (long_vectors_ ? Loops::solve_avx2(*this, batches, spring, h, enough, busy, changed, motions)
                      : Loops::solve(*this, batches, spring, h, enough, busy, changed, motions))
      any.store(true, std::memory_order_relaxed);
  });
  return any;
}

void ContactBatches::follow(std::span<const Motion> moved) {
  for_any([&](std::span<const Batch> batches) {
    long_vectors_ ? Loops::follow_avx2(batches, points_.data(), moved) : Loops::follow(batches, points_.data(), moved);
  });
}

void ContactBatches::add_up() {
  for_any([&](std::span<const Batch> batches) {
    for (Point& p : std::span(points_).subspan(batches.front().begin, batches.back().end - batches.front().begin)) {
      p.total += p.impulse;
      for (int k = 0; k < 2; ++k) p.side_total[k] += p.side_impulse[k];
    }
  });
}

bool ContactBatches::bounces(std::size_t i, btScalar threshold) const {
  const Pair& pair = pairs_[i];
  const std::size_t lane = i - batches_[batch_of_[i]].first;
  const auto met = [&](const Point& p) { return p.met[lane] >= threshold && p.total[lane] != 0; };
  return pair.restitution > 0 && std::any_of(points_.begin() + pair.begin, points_.begin() + pair.end, met);
}

btScalar ContactBatches::bounce(std::size_t i, btScalar factor, btScalar threshold, btScalar h,
                                std::span<Motion> motions) {
  const Pair& pair = pairs_[i];
  const Batch& batch = batches_[batch_of_[i]];
  const std::size_t l = i - batch.first;
  btScalar change = 0;
  if (pair.restitution == 0) return change;
  WideMotion m = load(motions, batch.a, batch.b);
  for (std::uint32_t k = pair.begin; k < pair.end; ++k) {
    Point& p = points_[k];
    if (p.met[l] < threshold || p.total[l] == 0) continue;
    p.bounced[l] = 1;
    const btScalar left = bounce_speed(factor * pair.restitution * p.met[l], p.by_force[l], p.gap[l], h);
    Wide by{};
    by[l] = btMax((left - dot(p.normal, Loops::speed(p, m))[l]) * p.step[l], -p.impulse[l]);
    p.impulse += by;
    p.total += by;
    Loops::apply(batch, p, by * p.normal, m);
    change = btMax(change, btFabs(by[l]) / p.step[l]);
  }
  store(m, batch.a, batch.b, motions);
  return change;
}

void ContactBatches::write_impulses() {
  for_any([&](std::span<const Batch> batches) {
    for (const Batch& batch : batches) {
      for (std::size_t l = 0; l < batch.pairs; ++l) write_impulses(batch, l);
    }
  });
}

void ContactBatches::write_impulses(const Batch& batch, std::size_t l) {
  const Pair& pair = pairs_[batch.first + l];
  for (std::uint32_t i = pair.begin; i < pair.end; ++i) {
    btManifoldPoint& point = pair.manifold->getContactPoint(static_cast<int>(i - pair.begin));
    const Point& p = points_[i];
    point.m_appliedImpulse = p.total[l];
    point.m_appliedImpulseLateral1 = p.side_total[0][l];
    point.m_appliedImpulseLateral2 = p.side_total[1][l];
    set_last_part(point,
                  p.bounced[l] != 0 ? LastPart{} : LastPart{p.impulse[l], p.side_impulse[0][l], p.side_impulse[1][l]});
  }
}

}  // namespace subworld::bullet
