#include "haptic_sim/border_model.hpp"

#include "haptic_sim/ghosts.hpp"

namespace subworld {

namespace {

/// The world's impulses of its last step, divided over the haptic steps (paper 4.2).
class FrozenBorder final : public BorderModel {
 public:
  FrozenBorder() {
    border_.reserve(4 * kUsualMembers);
    impulses_.reserve(4 * kUsualMembers);
  }

  void follow(const WorldFrame& frame, std::span<const StampedBody>, Engine&, const Following&) override {
    border_ = frame.border;
    cycle_s_ = frame.cycle_s;
    for_step_s_ = 0.0;
  }
  std::optional<BodyState> release(BodyId, Engine&) override { return std::nullopt; }
  void clear(Engine&) override { border_.clear(); }
  void begin(Engine& engine, double dt, double) override {
    if (dt != for_step_s_) {
      frozen_impulses(border_, dt / cycle_s_, impulses_);
      for_step_s_ = dt;
    }
    for (const PointImpulse& i : impulses_) {
      if (engine.contains(i.body)) engine.apply_impulse(i.body, i.impulse, i.point);
    }
  }
  void end(const Engine&, double) override {}
  void log(std::uint64_t, const Engine&) override {}

 private:
  double cycle_s_ = 1.0;  ///< over which the world had these impulses
  std::vector<BoundaryContact> border_;
  std::vector<PointImpulse> impulses_;
  double for_step_s_ = 0.0;  ///< the step that the impulses are for
};

}  // namespace

std::unique_ptr<BorderModel> make_border_model(const Scheme& scheme, const Scene& scene,
                                               std::uint64_t remembered_cycles) {
  if (scheme.border() == Border::frozen) return std::make_unique<FrozenBorder>();
  return std::make_unique<Ghosts>(scene, remembered_cycles);
}

}  // namespace subworld
