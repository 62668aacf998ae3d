#pragma once

#include "model/scene/scene.hpp"

#include <span>
#include <vector>

namespace subworld {

/// Bodies that joints connect, not through fixed ones. A sub-world has a mechanism as a whole: no border cuts a joint,
/// so the operator feels all of its inertia, friction and limits at the haptic rate.
class Mechanisms {
 public:
  explicit Mechanisms(const Scene& scene);

  /// The movable bodies of one's mechanism, ascending; without joints, none.
  [[nodiscard]] std::span<const BodyId> of(BodyId id) const noexcept {
    return groups_.empty() ? std::span<const BodyId>{} : std::span(groups_[group_[index(id)]]);
  }
  /// Adds the mechanisms of the ids; afterwards they ascend.
  void complete(std::vector<BodyId>& ids) const;
  /// The joint has broken: what it held together no longer is.
  void break_joint(std::size_t joint);

 private:
  void find();

  const Scene& scene_;
  std::vector<bool> broken_;                 ///< by joint
  std::vector<std::uint32_t> group_;         ///< by body; 0: none
  std::vector<std::vector<BodyId>> groups_;  ///< the first is empty
};

}  // namespace subworld
