#include "world_sim/run_control.hpp"

namespace subworld {

std::string RunControl::follow(const Control& order) {
  switch (order.verb) {
    case ControlVerb::stop:
      stopped_ = true;
      return "stop: the next frame is the last";
    case ControlVerb::pause:
      paused_ = true;
      return "paused";
    case ControlVerb::resume:
      paused_ = false;
      granted_ = 0;
      return "resumed";
    case ControlVerb::step:
      paused_ = true;
      ++granted_;
      return "one cycle, then paused until resume";
    case ControlVerb::reset:
    case ControlVerb::set_engine:
    case ControlVerb::set_scheme:
      break;
  }
  return "refused: this world follows stop, pause, resume and step; start a new run for anything else";
}

bool RunControl::may_step() noexcept {
  if (!paused_) return true;
  if (granted_ == 0) return false;
  --granted_;
  return true;
}

}  // namespace subworld
