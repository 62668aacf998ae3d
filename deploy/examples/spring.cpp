// A driver of a device: a mass of 0.1 kg on a spring whose other end moves 5 cm to and fro. It stands for an arm and
// its operator, so that no hardware is needed; a driver of hardware calls its library in the same four functions.
#include "device_sim/driver.hpp"

#include <chrono>
#include <cmath>

namespace {

using namespace subworld;

class Spring final : public DeviceDriver {
 public:
  DriverCapabilities open(const DriverRequest&) override {
    begin_ = Clock::now();
    return {.degrees_of_freedom = 3,
            .workspace_m = 0.2,
            .force_limit_n = 10.0,
            .torque_limit_n_m = 0.0,
            .rate_hz = 1000.0,
            .measures_velocity = true};
  }

  bool read(DriverReading& reading) override {
    constexpr double kMass_kg = 0.1, kStiffness_n_m = 200.0, kDamping_n_s_m = 5.0;
    constexpr double kReach_m = 0.05, kRate_rad_s = 3.0;
    const double now_s = std::chrono::duration<double>(Clock::now() - begin_).count();
    if (now_s <= time_s_) return false;
    for (; time_s_ < now_s; time_s_ += kStep_s) {
      for (std::size_t i = 0; i < 3; ++i) {
        const double end_m = i == 0 ? kReach_m * (1.0 - std::cos(kRate_rad_s * time_s_)) : 0.0;
        const double force_n =
            kStiffness_n_m * (end_m - position_m_[i]) - kDamping_n_s_m * velocity_m_s_[i] + force_n_[i];
        velocity_m_s_[i] += kStep_s * force_n / kMass_kg;
        position_m_[i] += kStep_s * velocity_m_s_[i];
      }
    }
    reading = {.time_s = time_s_, .position_m = position_m_};
    reading.linear_velocity_m_s = velocity_m_s_;
    return true;
  }

  void write(const DriverWrench& wrench) override { force_n_ = wrench.force_n; }
  void close() override {}

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr double kStep_s = 1e-4;
  Clock::time_point begin_;
  double time_s_ = 0.0;
  std::array<double, 3> position_m_{}, velocity_m_s_{}, force_n_{};
};

constexpr DriverPlugin kPlugin{.name = "spring", .version = "1", .settings = "none", .make = [] {
                                 return std::unique_ptr<DeviceDriver>(std::make_unique<Spring>());
                               }};

}  // namespace

SUBWORLD_DRIVER_PLUGIN(kPlugin)
