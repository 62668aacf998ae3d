#pragma once

#include "coupling/messages/suppression.hpp"
#include "coupling/schemes/scheme.hpp"
#include "model/scene/scene.hpp"

#include <optional>
#include <vector>

namespace subworld {

/// For how long, and in which place, a proxy that is alone in its sub-world will stay alone
/// (coupling/messages/suppression).
class SuppressionFinder {
 public:
  SuppressionFinder(const Scene& scene, const Scheme& scheme) : scene_(scene), scheme_(scheme) {}

  /// Empty where something may come so soon that suppression is not worth it.
  std::optional<Suppression> find(const UserSpec& user, const WorldNow& now);

 private:
  /// What moves but the proxy. Any of it may hit any other, so one motion bounds all.
  struct Others {
    std::vector<BodyId> ids;
    BodyState fastest;
    double longest_arm_m = 0.0;
  };
  void look_at_others(BodyId proxy, const WorldNow& now);
  /// Where others are or come within the time, as far as that meets the place.
  void list_obstacles(const Box& place, double time_s, const WorldNow& now);

  const Scene& scene_;
  const Scheme& scheme_;
  Others others_;
  std::vector<BodyId> asleep_;
  std::vector<Box> obstacles_;
};

}  // namespace subworld
