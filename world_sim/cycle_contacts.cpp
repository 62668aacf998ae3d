#include "world_sim/cycle_contacts.hpp"

#include "coupling/plan.hpp"

#include <algorithm>
#include <utility>

namespace subworld {

namespace {

/// How far a contact point may move in a sub-step, of the smaller body's size.
constexpr double kContactReachRatio = 0.025;

}  // namespace

CycleContacts::CycleContacts(const Scene& scene, bool has_sub_worlds, RestingEngine& engine)
    : engine_(engine),
      bodies_(scene.bodies.size()),
      reads_friction_(has_sub_worlds || !enabled(scene, Optimisation::impulses)),
      reads_friction_later_(has_sub_worlds && enabled(scene, Optimisation::impulses)) {}

std::span<const Contact> CycleContacts::of_step(int substeps) {
  lacks_friction_ = !reads_friction_;
  if (reads_friction_later_ && substeps == 1) {
    lacks_friction_ = engine_.capabilities().tangential_impulse == Fidelity::estimated;
  }
  return lacks_friction_ ? engine_.contacts() : engine_.contacts_with_friction();
}

void CycleContacts::add(int substep, int count) {
  if (substep == 0) totals_.clear();
  const std::span<const Contact> contacts = of_step(count);
  if (count == 1) {
    contacts_ = contacts;
    return;
  }
  const auto size = [&](BodyId id) {
    const Box box = engine_.bounds(id);
    return (box.upper - box.lower).minCoeff();
  };
  for (const Contact& c : contacts) totals_.add(c, substep, kContactReachRatio * std::min(size(c.a), size(c.b)));
  if (substep + 1 < count) return;
  totals_.merge();
  contacts_ = totals_.contacts();
}

void CycleContacts::take_settled(double scale) {
  const std::span<const Contact> now = engine_.contacts_with_friction();
  settled_.assign(now.begin(), now.end());
  for (Contact& c : settled_) {
    c.normal_impulse *= scale;
    c.tangential_impulse *= scale;
  }
  contacts_ = settled_;
}

bool CycleContacts::find_friction() {
  if (!std::exchange(lacks_friction_, false)) return false;
  contacts_ = engine_.contacts_with_friction();
  build_graph();
  return true;
}

}  // namespace subworld
