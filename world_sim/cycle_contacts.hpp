#pragma once

#include "coupling/select/contact_graph.hpp"
#include "model/scene/scene.hpp"
#include "physics/contact_totals.hpp"
#include "physics/shells/resting_engine.hpp"

#include <span>
#include <vector>

namespace subworld {

/// The contacts of the world's last cycle: the totals of its sub-steps, with friction where somebody reads it.
class CycleContacts {
 public:
  CycleContacts(const Scene& scene, bool has_sub_worlds, RestingEngine& engine);

  /// After each sub-step, of `count`.
  void add(int substep, int count);
  /// Those of the step before, with impulses multiplied by `scale`: as if the last step of settling had been a cycle.
  void take_settled(double scale);
  /// Until the next cycle there are none.
  void clear() noexcept { contacts_ = {}; }
  void build_graph() { graph_.build(contacts_, bodies_); }
  /// Of the last step's contacts, if they lack it; false if not.
  bool find_friction();

  [[nodiscard]] const std::span<const Contact>& all() const noexcept { return contacts_; }
  [[nodiscard]] const ContactGraph& graph() const noexcept { return graph_; }

 private:
  [[nodiscard]] std::span<const Contact> of_step(int substeps);

  RestingEngine& engine_;
  std::size_t bodies_;
  bool reads_friction_;        ///< somebody may
  bool reads_friction_later_;  ///< and knows only when the step is over
  bool lacks_friction_ = false;
  ContactTotals totals_;
  std::vector<Contact> settled_;
  std::span<const Contact> contacts_;
  ContactGraph graph_;
};

}  // namespace subworld
