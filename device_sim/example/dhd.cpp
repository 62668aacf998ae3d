// Driver of a Force Dimension device with three degrees of freedom (omega.3, delta.3) by its SDK, libdhd.
#include "device_sim/driver.hpp"

#include <dhdc.h>

#include <stdexcept>
#include <string>

namespace {

using namespace subworld;

/// Functions of the SDK return a negative number if they fail; DHD_TIMEGUARD, a positive one, is none.
void check(int result, const char* what) {
  if (result < 0) throw std::runtime_error(std::string(what) + ": " + dhdErrorGetLastStr());
}

class DhdDriver final : public DeviceDriver {
 public:
  DriverCapabilities open(const DriverRequest&) override {
    const int id = dhdOpen();
    check(id, "dhdOpen");
    id_ = static_cast<char>(id);
    is_open_ = true;
    check(dhdEnableForce(DHD_ON, id_), "dhdEnableForce");
    return {.degrees_of_freedom = 3,
            .workspace_m = 0.08,
            .force_limit_n = 12.0,
            .torque_limit_n_m = 0.0,
            .rate_hz = 1000.0,
            .measures_velocity = true};
  }

  bool read(DriverReading& reading) override {
    auto& [x, y, z] = reading.position_m;
    check(dhdGetPosition(&x, &y, &z, id_), "dhdGetPosition");
    auto& [vx, vy, vz] = reading.linear_velocity_m_s;
    check(dhdGetLinearVelocity(&vx, &vy, &vz, id_), "dhdGetLinearVelocity");
    reading.time_s = dhdGetTime();
    reading.buttons = dhdGetButton(0, id_) > 0 ? 1U : 0U;
    return true;
  }

  void write(const DriverWrench& wrench) override {
    const auto& [fx, fy, fz] = wrench.force_n;
    check(dhdSetForceAndTorque(fx, fy, fz, 0.0, 0.0, 0.0, id_), "dhdSetForceAndTorque");
  }

  void close() override {
    if (!is_open_) return;
    is_open_ = false;
    dhdEnableForce(DHD_OFF, id_);
    dhdClose(id_);
  }

 private:
  char id_ = -1;
  bool is_open_ = false;
};

constexpr DriverPlugin kPlugin{.name = "dhd", .version = "1", .settings = "", .make = [] {
                                 return std::unique_ptr<DeviceDriver>(std::make_unique<DhdDriver>());
                               }};

}  // namespace

SUBWORLD_DRIVER_PLUGIN(kPlugin)
