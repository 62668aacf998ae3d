#include "world_sim/loops/run_control.hpp"

#include <algorithm>

namespace subworld {

namespace {

/// What any program of the network may have sent, for a line of text.
std::string on_one_line(const std::string& sent) {
  constexpr std::size_t kMost = 120;
  std::string text = sent.substr(0, kMost);
  std::ranges::replace_if(
      text, [](char c) { return c >= 0 && c < ' '; }, ' ');
  return text;
}

}  // namespace

OrderAnswer RunControl::follow(const Control& order) {
  switch (order.verb) {
    case ControlVerb::stop:
      stopped_ = true;
      if (!order.argument.empty()) stopped_by_ = "control (" + on_one_line(order.argument) + ")";
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
