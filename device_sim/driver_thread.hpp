#pragma once

#include "device_sim/driver.hpp"
#include "rt/cyclic.hpp"

#include <array>
#include <cstdint>
#include <memory>
#include <string>

namespace subworld {

/// Without a new wrench for so long, s, a driver outputs none: the loop that computes it has stopped.
inline constexpr double kOldWrench_s = 0.01;
/// After such a time, or one in which the driver was blocked, or a wrench that is not finite, the output rises from
/// zero in this time, s.
inline constexpr double kOutputRise_s = 0.02;

/// Runs a driver in a thread of its own. Newest values go to and fro without locks, so a driver that blocks stops
/// nothing but itself. After an exception the driver is closed, and every kRetry_s a new one is opened.
class DriverThread {
 public:
  static constexpr double kRetry_s = 0.5;

  struct Sample {
    std::uint64_t number = 0;  ///< counts the readings
    DriverReading reading;
  };
  enum class Phase : std::uint8_t { opening, open, lost, refused };
  struct Report {
    std::uint64_t number = 0;  ///< counts the changes
    Phase phase = Phase::opening;
    DriverCapabilities capabilities;
    std::array<char, 240> text{};  ///< why it was lost, or its settings refused
  };

  DriverThread(const DriverPlugin& plugin, std::string settings, int user, int domain);
  /// Outputs no wrench and closes the driver. One that does not return within kPatience_s is abandoned.
  ~DriverThread();
  DriverThread(const DriverThread&) = delete;
  DriverThread& operator=(const DriverThread&) = delete;

  [[nodiscard]] Sample newest() const noexcept;
  [[nodiscard]] Report report() const noexcept;
  /// From now on this wrench is to be output, for at most kOldWrench_s.
  void write(const DriverWrench& wrench) noexcept;

 private:
  static constexpr double kPatience_s = 1.0;
  struct Exchange;
  std::shared_ptr<Exchange> exchange_;
};

}  // namespace subworld
