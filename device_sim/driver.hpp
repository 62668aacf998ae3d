#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string_view>

/// The interface between `device_sim` and the driver of a device. This header needs the standard library only. All
/// units are SI; axes are parallel to the scene's.
namespace subworld {

struct DriverCapabilities {
  int degrees_of_freedom = 3;  ///< 3: translation, 6: also rotation
  double workspace_m = 0.1;    ///< no coordinate of a position is further from 0
  double force_limit_n = 0.0;  ///< largest force; 0: the device renders none, and write() is not called
  double torque_limit_n_m = 0.0;
  double rate_hz = 1000.0;  ///< of new readings; read() and write() are called at this rate
  bool measures_velocity = false;
};

struct DriverReading {
  double time_s = 0.0;  ///< when it was measured, by any clock that runs at the pace of seconds
  std::array<double, 3> position_m{};
  std::array<double, 4> orientation{1.0, 0.0, 0.0, 0.0};  ///< unit quaternion w, x, y, z
  std::array<double, 3> linear_velocity_m_s{};            ///< where the device measures it
  std::array<double, 3> angular_velocity_rad_s{};
  std::uint32_t buttons = 0;  ///< bit n: button n is pressed
};

/// On the operator.
struct DriverWrench {
  std::array<double, 3> force_n{};
  std::array<double, 3> torque_n_m{};
};

struct DriverRequest {
  std::string_view settings;  ///< `--device-settings`, whose format is the driver's
  int user = 0;               ///< whom the device serves
  int domain = 0;             ///< of DDS: tells apart the runs on this machine
};

/// One device. All functions are called by one thread, which is not the loop of `device_sim`. They may allocate and
/// lock, and may throw a `std::exception` that says what is wrong. They may not change signals, scheduling or the
/// memory of others. Limits, ramps and plausibility are checked by `device_sim`: a driver passes on what it is given.
class DeviceDriver {
 public:
  DeviceDriver() = default;
  virtual ~DeviceDriver() = default;
  DeviceDriver(const DeviceDriver&) = delete;
  DeviceDriver& operator=(const DeviceDriver&) = delete;

  /// Called once. Throws where the device is not there: `device_sim` makes another driver later and tries again. Throws
  /// `std::invalid_argument` where the settings are wrong: the run ends.
  virtual DriverCapabilities open(const DriverRequest& request) = 0;
  /// Returns false, at once or within a period, if there is no reading since the last one. Throws if the device is
  /// gone.
  virtual bool read(DriverReading& reading) = 0;
  /// Outputs the wrench until the next call. Finite, and within the limits of the capabilities. Throws if that fails.
  virtual void write(const DriverWrench& wrench) = 0;
  /// The last call, also after an exception of another one; a zero wrench was written before where that was possible.
  virtual void close() = 0;
};

/// Description of a driver in its library, and the function that makes it.
struct DriverPlugin {
  std::string_view name;
  std::string_view version;
  std::string_view settings;  ///< what `--device-settings` may be, one line
  std::unique_ptr<DeviceDriver> (*make)();
};

/// Changes whenever a type of this header changes.
inline constexpr int kDriverPluginInterface = 2;

}  // namespace subworld

/// Exports the driver of a library; use once in each. A library of another interface or compiler is refused.
#define SUBWORLD_DRIVER_PLUGIN(plugin)                                                                         \
  extern "C" __attribute__((visibility("default"))) const ::subworld::DriverPlugin* subworld_driver_plugin() { \
    return &(plugin);                                                                                          \
  }                                                                                                            \
  extern "C" __attribute__((visibility("default"))) int subworld_driver_plugin_interface() {                   \
    return ::subworld::kDriverPluginInterface;                                                                 \
  }                                                                                                            \
  extern "C" __attribute__((visibility("default"))) const char* subworld_driver_plugin_compiler() {            \
    return __VERSION__;                                                                                        \
  }
