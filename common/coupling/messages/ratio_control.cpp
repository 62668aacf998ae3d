#include "coupling/messages/ratio_control.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

RatioControl::RatioControl(const Settings& settings)
    : h_s_(settings.h_s),
      least_(settings.ratio),
      most_(settings.largest_ratio()),
      given_parts_(settings.world.substeps.value_or(0)) {}

int RatioControl::smallest_affordable(double share, const CycleCost& cost) const {
  int ratio = least_;
  while (ratio < most_ && cost(ratio * h_s_, std::max(1, given_parts_)) > share * ratio * h_s_) ++ratio;
  return ratio;
}

int RatioControl::choose_ratio(int present, bool border_is_felt, double cycle_s, const CycleCost& cost) {
  quiet_s_ = border_is_felt ? 0.0 : quiet_s_ + cycle_s;
  if (least_ == most_) return least_;
  if (quiet_s_ > kSettled_s) {
    cheap_s_ = 2.0 * kSettled_s;  // what is felt next is met at once
    return most_;
  }
  const int comfortable = smallest_affordable(kShare, cost);
  if (smallest_affordable(kOverShare, cost) > present) return comfortable;
  const int within = std::clamp(present, least_, most_);
  if (!border_is_felt) return within;
  cheap_s_ = comfortable < present ? cheap_s_ + cycle_s : 0.0;
  return cheap_s_ > kSettled_s ? comfortable : within;
}

int RatioControl::choose_substeps(int present, double cycle_s, double longest_substep_s, double time_s,
                                  const CycleCost& cost) const {
  if (given_parts_ > 0) return given_parts_;
  const int wanted = std::max(1, static_cast<int>(std::ceil(cycle_s / longest_substep_s - 1e-9)));
  const auto affordable = [&](int parts, double share) { return cost(cycle_s, parts) <= share * time_s; };
  if (present <= wanted && !affordable(present, kOverShare)) present = 1;
  int parts = wanted;
  while (parts > std::min(present, wanted) && !affordable(parts, kShare)) --parts;
  return parts;
}

}  // namespace subworld
