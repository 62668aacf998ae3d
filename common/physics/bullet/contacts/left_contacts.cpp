#include "physics/bullet/contacts/left_contacts.hpp"

#include "model/sorted.hpp"

#include <algorithm>
#include <utility>

namespace subworld::bullet {

namespace {

/// Rounding of a position that is converted to the engine's unit of length and back.
constexpr auto kLengthRounding = 16 * SIMD_EPSILON;
constexpr std::size_t kUsualLeft = 256;  ///< pairs that wait: room for them, so that steps allocate nothing

std::uint32_t number(const btCollisionObject& body) { return static_cast<std::uint32_t>(body.getUserIndex()); }

/// Ids of the bodies of a manifold, the lower first.
std::pair<std::uint32_t, std::uint32_t> numbers(const btPersistentManifold& manifold) {
  return std::minmax({number(*manifold.getBody0()), number(*manifold.getBody1())});
}

/// A manifold's impulses act on its first body.
btScalar sign(const btPersistentManifold& manifold) {
  return number(*manifold.getBody0()) < number(*manifold.getBody1()) ? btScalar(1) : btScalar(-1);
}

bool is_new(const btPersistentManifold& manifold) {
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    if (manifold.getContactPoint(i).m_appliedImpulse != 0) return false;
  }
  return manifold.getNumContacts() > 0;
}

}  // namespace

bool leaves(const btCollisionObject& body) { return body.getUserIndex2() == kLeaves; }

LeftContacts::LeftContacts() { pairs_.reserve(kUsualLeft); }

void LeftContacts::keep(const btCollisionObject& body, btDispatcher& dispatcher) {
  if (away_.size() <= number(body)) away_.resize(number(body) + std::size_t{1});
  away_[number(body)] = body.getWorldTransform().getOrigin();
  for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
    const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(m);
    if (manifold.getBody0() == &body || manifold.getBody1() == &body) keep(manifold);
  }
}

void LeftContacts::keep_leaving(btDispatcher& dispatcher) {
  for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
    const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(m);
    if (leaves(*manifold.getBody0()) || leaves(*manifold.getBody1())) keep(manifold);
  }
}

void LeftContacts::keep(const btPersistentManifold& manifold) {
  if (manifold.getNumContacts() == 0 || is_new(manifold)) return;
  const auto [low, high] = numbers(manifold);
  Pair& pair = pairs_.emplace_back(Pair{low, high, 0, {}});
  const btScalar on_low = sign(manifold);
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    const btManifoldPoint& p = manifold.getContactPoint(i);
    const LastPart last = last_part_of(p);
    pair.points[pair.count++] = {
        p.getPositionWorldOnB(), p.m_appliedImpulse, last.normal,
        on_low * (p.m_appliedImpulseLateral1 * p.m_lateralFrictionDir1 +
                  p.m_appliedImpulseLateral2 * p.m_lateralFrictionDir2),
        on_low * (last.lateral_1 * p.m_lateralFrictionDir1 + last.lateral_2 * p.m_lateralFrictionDir2)};
  }
}

void LeftContacts::came(const btCollisionObject& body) {
  if (!is_away(number(body))) return;
  const btVector3 left = *std::exchange(away_[number(body)], std::nullopt);
  const btVector3& here = body.getWorldTransform().getOrigin();
  if ((here - left).length() <= kLengthRounding * here.length()) {
    expects_ = true;
    return;
  }
  std::erase_if(pairs_, [&](const Pair& pair) { return pair.low == number(body) || pair.high == number(body); });
}

void LeftContacts::give_back(btDispatcher& dispatcher) {
  if (!std::exchange(expects_, false)) return;
  const auto key = [](const Pair& pair) { return std::pair(pair.low, pair.high); };
  std::ranges::sort(pairs_, {}, key);
  for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
    btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(m);
    if (!is_new(manifold)) continue;
    const auto pair = find_sorted(pairs_, numbers(manifold), key);
    if (pair == pairs_.end()) continue;
    const btScalar on_low = sign(manifold), same = manifold.getContactBreakingThreshold();
    for (int i = 0; i < manifold.getNumContacts(); ++i) {
      btManifoldPoint& p = manifold.getContactPoint(i);
      // The order of the bodies may have changed, so the stored place may be on either body. The nearer point is the
      // right one.
      const auto off = [&](const Left& left) {
        return btMin((left.place - p.getPositionWorldOnB()).length2(),
                     (left.place - p.getPositionWorldOnA()).length2());
      };
      const auto left = std::ranges::min_element(pair->points.begin(), pair->points.begin() + pair->count, {}, off);
      if (off(*left) > same * same) continue;
      const btVector3 &first = p.m_lateralFrictionDir1, &second = p.m_lateralFrictionDir2;
      p.m_appliedImpulse = left->normal;
      p.m_appliedImpulseLateral1 = on_low * first.dot(left->across);
      p.m_appliedImpulseLateral2 = on_low * second.dot(left->across);
      set_last_part(p,
                    {left->last_normal, on_low * first.dot(left->last_across), on_low * second.dot(left->last_across)});
    }
  }
  std::erase_if(pairs_, [this](const Pair& pair) { return !is_away(pair.low) && !is_away(pair.high); });
}

}  // namespace subworld::bullet
