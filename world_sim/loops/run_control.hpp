#pragma once

#include "model/messages/exchange.hpp"

#include <string>

namespace subworld {

/// What `control` asked of the world's clock.
class RunControl {
 public:
  /// Follows one order. Returns what it did, or why not.
  OrderAnswer follow(const Control& order);

  /// Whether the world may make its next cycle; a granted single step is used up.
  [[nodiscard]] bool may_step() noexcept;
  [[nodiscard]] bool paused() const noexcept { return paused_; }
  [[nodiscard]] bool stopped() const noexcept { return stopped_; }
  /// "control", with the sender where the order names it.
  [[nodiscard]] const std::string& stopped_by() const noexcept { return stopped_by_; }

 private:
  bool paused_ = false;
  bool stopped_ = false;
  std::string stopped_by_ = "control";
  int granted_ = 0;  ///< cycles, while paused
};

}  // namespace subworld
