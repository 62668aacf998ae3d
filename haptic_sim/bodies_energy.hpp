#pragma once

#include "coupling/safety/energy_port.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"
#include "model/sorted.hpp"
#include "physics/engine.hpp"

#include <algorithm>
#include <cstdint>
#include <set>
#include <span>
#include <vector>

namespace subworld {

/// The energy that bodies can give back, by now: what the newest frame says, and what the members have gained or lost
/// since, here.
class BodiesEnergy {
 public:
  explicit BodiesEnergy(const Scene& scene) : scene_(scene) {
    for (const Joint& joint : scene.joints) {
      if (has_spring(joint)) springs_.push_back(&joint);
    }
  }
  /// These joints have broken, since the start: those that are new to it break in the engine too, and their springs no
  /// longer count.
  void break_joints(std::span<const std::uint32_t> broken, Engine& engine) {
    for (const std::uint32_t joint : broken) {
      if (joint >= scene_.joints.size() || !broken_.insert(joint).second) continue;
      engine.break_joint(joint);
      std::erase(springs_, &scene_.joints[joint]);
    }
  }

  void follow(const WorldFrame& frame, std::span<const BodyId> members) {
    at_frame_j_ = sum(members, [&frame](BodyId id) -> const BodyState* {
      const auto at = find_sorted(frame.states, id, &StampedBody::id);
      return at == frame.states.end() ? nullptr : &at->state;
    });
    said_j_ = frame.bodies_j;
    since_j_ = 0.0;
  }
  /// After a step.
  void observe(const Engine& engine, std::span<const BodyId> members) {
    BodyState now;
    since_j_ = sum(members, [&](BodyId id) { return &(now = engine.state(id)); }) - at_frame_j_;
  }
  /// With the work of the others, J. Energy below the least that the bodies have had is work of theirs.
  [[nodiscard]] OthersEnergy beside(double work_j) const noexcept {
    const double now_j = said_j_ + since_j_;
    return {work_j + std::max(0.0, -now_j), std::max(0.0, now_j)};
  }

 private:
  /// Of the members that are no user's proxy, kinetic and potential.
  template <class StateOf>
  [[nodiscard]] double sum(std::span<const BodyId> members, const StateOf& state_of) const {
    double all_j = 0.0;
    for (const Joint* const joint : springs_) {
      const auto state = [&](BodyId id) {
        const BodyState* const at = scene_.body(id).fixed() ? &scene_.initial[index(id)] : state_of(id);
        return at == nullptr ? scene_.initial[index(id)] : *at;
      };
      if (!std::ranges::binary_search(members, joint->a) && !std::ranges::binary_search(members, joint->b)) continue;
      all_j += spring_energy(*joint, pose_of(state(joint->a)), pose_of(state(joint->b)));
    }
    for (const BodyId id : members) {
      if (std::ranges::find(scene_.users, id, &UserSpec::proxy) != scene_.users.end()) continue;
      const BodyState* const state = state_of(id);
      const Body& body = scene_.body(id);
      if (state == nullptr) continue;
      all_j += kinetic_energy(body, *state);
      if (body.gravity) all_j -= body.mass * scene_.settings.world.gravity.dot(state->position);
    }
    return all_j;
  }

  const Scene& scene_;
  std::vector<const Joint*> springs_;  ///< joints with springs
  std::set<std::uint32_t> broken_;
  double at_frame_j_ = 0.0, said_j_ = 0.0, since_j_ = 0.0;
};

}  // namespace subworld
