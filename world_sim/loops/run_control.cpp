#include "world_sim/loops/run_control.hpp"

namespace subworld {

OrderAnswer RunControl::follow(const Control& order) {
  switch (order.verb) {
    case ControlVerb::stop:
      stopped_ = true;
      if (!order.argument.empty()) stopped_by_ = "control (" + order.argument + ")";
      return {OrderState::done, "stop: the next frame is the last"};
    case ControlVerb::pause:
      paused_ = true;
      return {OrderState::done, "paused"};
    case ControlVerb::resume:
      paused_ = false;
      granted_ = 0;
      return {OrderState::done, "resumed"};
    case ControlVerb::step:
      paused_ = true;
      ++granted_;
      return {OrderState::done, "one cycle, then paused until resume"};
    default:
      return {OrderState::refused,
              "this world follows stop, pause, resume and step; start a new run for anything else"};
  }
}

bool RunControl::may_step() noexcept {
  if (!paused_) return true;
  if (granted_ == 0) return false;
  --granted_;
  return true;
}

}  // namespace subworld
