#include "coupling/schemes/paper/paper.hpp"

#include "coupling/select/border.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

class PaperWorldSide final : public WorldSide {
 public:
  explicit PaperWorldSide(const PaperSettings& settings) : settings_(settings) { contacts_.reserve(kUsualContacts); }

  ProxyDrive drive(const UserSpec&, const Wrench& mean, const HapticReport&, const HapticReport&,
                   double) const override {
    if (!settings_.device_force_in_world) return {};
    return {mean, std::nullopt, {}};
  }
  void extract(const WorldNow& now, const Inside& inside, Border& border, WorldFrame&) override {
    now.graph.contacts_of(inside.membership.members, contacts_);
    extract_border(contacts_, inside.membership, border.contacts);
  }

 private:
  PaperSettings settings_;
  std::vector<Contact> contacts_;  ///< of the members
};

/// The world's impulses of its last step, divided over the haptic steps.
class FrozenBorder final : public SubWorldSide {
 public:
  FrozenBorder() {
    border_.reserve(4 * kUsualMembers);
    impulses_.reserve(4 * kUsualMembers);
  }

  void follow(const WorldFrame& frame, Engine&, const Following&) override {
    border_ = frame.border;
    cycle_s_ = frame.cycle_s;
    for_step_s_ = 0.0;
  }
  std::optional<BodyState> release(BodyId, Engine&) override { return std::nullopt; }
  void clear(Engine&) override { border_.clear(); }
  void begin(Engine& engine, double dt, double, std::span<const PeerPull>) override {
    if (dt != for_step_s_) {
      frozen_impulses(border_, dt / cycle_s_, impulses_);
      for_step_s_ = dt;
    }
    for (const PointImpulse& i : impulses_) {
      if (engine.contains(i.body)) engine.apply_impulse(i.body, i.impulse, i.point);
    }
  }

 private:
  double cycle_s_ = 1.0;  ///< over which the world had these impulses
  std::vector<BoundaryContact> border_;
  std::vector<PointImpulse> impulses_;
  double for_step_s_ = 0.0;  ///< the step for which `impulses_` were made
};

Correction paper_correction(const CopyPair& pair, const Indicators& indicators, const Settings& settings) noexcept {
  const double s = pair.owner == Owner::peer   ? 0.0
                   : pair.owner == Owner::user ? 1.0
                                               : blend_weight(indicators, settings.paper);
  return {.world = s, .sub = 1.0 - s};
}

}  // namespace

double blend_weight(const Indicators& in, const PaperSettings& settings) noexcept {
  if (in.border_bodies == 0) return 1.0;
  if (in.proxy_contacts == 0) return 0.0;
  if (in.device_impulse_n_s < settings.device_impulse_threshold_n_s) return 0.0;
  if (!(in.total_impulse_n_s > 0.0)) return 0.0;
  return std::sqrt(std::clamp(in.proxy_impulse_n_s / in.total_impulse_n_s, 0.0, 1.0));
}

void frozen_impulses(std::span<const BoundaryContact> border, double fraction, std::vector<PointImpulse>& out) {
  out.clear();
  for (const BoundaryContact& pair : border) {
    out.push_back({pair.inside, fraction * (pair.normal_impulse * pair.normal + pair.tangential_impulse), pair.point});
  }
}

constinit const Scheme kPaper{.properties = {.name = "paper",
                                             .summary = "Glondu et al. 2010: frozen border impulses, blended copies",
                                             .weighs_impulses = true,
                                             .creates_energy_late = true},
                              .correction = paper_correction,
                              .make_world_side = [](const Scene& scene) -> std::unique_ptr<WorldSide> {
                                return std::make_unique<PaperWorldSide>(scene.settings.paper);
                              },
                              .make_sub_world_side = [](const Scene&, std::uint64_t) -> std::unique_ptr<SubWorldSide> {
                                return std::make_unique<FrozenBorder>();
                              }};

}  // namespace subworld
