// A device driver for tests. Its settings name one fault; "sound" has none. The handle moves on a circle.
#include "device_sim/driver.hpp"

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <stdexcept>
#include <string>
#include <thread>

namespace {

using namespace subworld;

class FaultyDriver final : public DeviceDriver {
 public:
  DriverCapabilities open(const DriverRequest& request) override {
    fault_ = request.settings;
    if (is("opens_never")) throw std::runtime_error("no such device");
    begin_ = zero_at_ = written_at_ = std::chrono::steady_clock::now();
    return {.degrees_of_freedom = is("dof") ? 5 : 6,
            .workspace_m = 0.1,
            .force_limit_n = 10.0,
            .torque_limit_n_m = 0.5,
            .rate_hz = 1000.0,
            .measures_velocity = true};
  }

  bool read(DriverReading& reading) override {
    ++reads_;
    const bool half = reads_ > 500;
    if (is("blocks") && half) std::this_thread::sleep_for(std::chrono::milliseconds(30));
    if (is("hangs") && half) std::this_thread::sleep_for(std::chrono::hours(1));
    if (is("strict_blocks") && reads_ == 300) std::this_thread::sleep_for(std::chrono::milliseconds(60));
    if ((is("throws") || is("strict_throws")) && half) throw std::runtime_error("unplugged");
    if (is("throws_a_number") && half) throw 1;
    if (is("crashes") && half) std::abort();
    if (is("slow") && reads_ % 4 != 0) return false;
    if (is("mute")) return false;
    constexpr double kRadius_m = 0.02, kRate_rad_s = 6.0;
    const double t = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
    const double c = std::cos(kRate_rad_s * t), s = std::sin(kRate_rad_s * t);
    reading = {.time_s = t, .position_m = {kRadius_m * c, kRadius_m * s, 0.0}};
    reading.linear_velocity_m_s = {-kRadius_m * kRate_rad_s * s, kRadius_m * kRate_rad_s * c, 0.0};
    if (is("frozen")) reading.position_m = {}, reading.linear_velocity_m_s = {};
    if (is("nan") && half) reading.position_m[1] = std::numeric_limits<double>::quiet_NaN();
    if (is("jumps") && reads_ % 100 == 0) reading.position_m[2] = 0.08;
    if (is("millimetres")) {
      for (double& x : reading.position_m) x *= 1e3;
      for (double& v : reading.linear_velocity_m_s) v *= 1e3;
    }
    if (is("quaternion")) reading.orientation = {1.0, 1.0, 0.0, 0.0};
    if (is("backwards")) reading.time_s = 100.0 - t;
    if (is("milliseconds")) reading.time_s *= 1e3;
    if (is("frozen_clock")) reading.time_s = 1.0;
    if (is("button") && t > 0.3 && t < 0.6) reading.buttons = 4;
    if (strict()) reading.buttons = static_cast<std::uint32_t>(size_n_ * 10.0);
    if (is("velocity")) reading.linear_velocity_m_s[0] *= 2.0, reading.linear_velocity_m_s[1] *= 2.0;
    return true;
  }

  void write(const DriverWrench& wrench) override {
    if (strict()) judge(wrench);
    if (is("write_fails")) throw std::runtime_error("no power");
    if (is("write_blocks")) std::this_thread::sleep_for(std::chrono::milliseconds(30));
  }

  void close() override {
    if (is("close_fails")) throw std::runtime_error("busy");
  }

 private:
  [[nodiscard]] bool is(const char* fault) const { return fault_ == fault; }
  [[nodiscard]] bool strict() const { return fault_.starts_with("strict"); }

  /// Refuses a force that a device must never get: it is finite, at most 10 N, and rises from zero in 20 ms.
  void judge(const DriverWrench& wrench) {
    constexpr double kLimit_n = 10.0, kRise_s = 0.02, kLate_s = 0.005;
    const auto now = std::chrono::steady_clock::now();
    const auto since = [&](auto then) { return std::chrono::duration<double>(now - then).count(); };
    size_n_ = std::hypot(wrench.force_n[0], wrench.force_n[1], wrench.force_n[2]);
    if (!std::isfinite(size_n_)) throw std::runtime_error("forbidden: a force that is not finite");
    if (size_n_ > kLimit_n * (1.0 + 1e-9)) throw std::runtime_error("forbidden: a force beyond the limit");
    if (since(written_at_) > 0.05) zero_at_ = now;  // blocked: what follows begins at zero
    if (size_n_ == 0.0) zero_at_ = now;
    if (size_n_ > kLimit_n * (since(zero_at_) + kLate_s) / kRise_s)
      throw std::runtime_error("forbidden: a force that jumps");
    written_at_ = now;
  }

  std::string fault_;
  std::chrono::steady_clock::time_point begin_, zero_at_, written_at_;
  double size_n_ = 0.0;  ///< of the newest force
  int reads_ = 0;
};

constexpr DriverPlugin kPlugin{.name = "faulty", .version = "1", .settings = "a fault", .make = [] {
                                 return std::unique_ptr<DeviceDriver>(std::make_unique<FaultyDriver>());
                               }};

}  // namespace

SUBWORLD_DRIVER_PLUGIN(kPlugin)
