// Driver of a SpaceMouse by libspnav and the daemon spacenavd: the deflection of the cap is a velocity.
#include "device_sim/driver.hpp"
#include "device_sim/drivers/settings.hpp"

#include <poll.h>
#include <spnav.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

namespace {

using namespace subworld;
using Clock = std::chrono::steady_clock;
using Triple = std::array<double, 3>;

constexpr double kFullDeflection = 350.0;  ///< of an axis, as spacenavd reports it with its default sensitivity

class SpaceMouseDriver final : public DeviceDriver {
 public:
  DriverCapabilities open(const DriverRequest& request) override {
    DriverSettings settings(request.settings);
    speed_m_s_ = settings.take("speed_m_s", 0.1);
    turn_rad_s_ = settings.take("turn_rad_s", 1.0);
    const double degrees_of_freedom = settings.take("dof", 6.0);
    workspace_m_ = settings.take("workspace_m", 0.5);
    settings.check();
    if (!(speed_m_s_ > 0.0 && speed_m_s_ <= 1.0)) throw std::invalid_argument("setting speed_m_s: must be up to 1 m/s");
    if (!(turn_rad_s_ > 0.0 && turn_rad_s_ <= 10.0))
      throw std::invalid_argument("setting turn_rad_s: must be up to 10 rad/s");
    if (spnav_open() < 0)
      throw std::runtime_error("spacenavd does not answer: install the package spacenavd and start it");
    is_open_ = true;
    begin_ = Clock::now();
    return {.degrees_of_freedom = static_cast<int>(degrees_of_freedom),
            .workspace_m = workspace_m_,
            .force_limit_n = 0.0,
            .torque_limit_n_m = 0.0,
            .rate_hz = 250.0,
            .measures_velocity = true};
  }

  bool read(DriverReading& reading) override {
    for (spnav_event event{}; spnav_poll_event(&event) != 0;) take(event);
    pollfd daemon{.fd = spnav_fd(), .events = POLLRDHUP, .revents = 0};
    if (poll(&daemon, 1, 0) > 0) throw std::runtime_error("spacenavd has ended");
    const double now_s = std::chrono::duration<double>(Clock::now() - begin_).count();
    const double passed_s = now_s - pose_.time_s;
    pose_.time_s = now_s;
    for (std::size_t i = 0; i < 3; ++i) {
      const double to_m = pose_.position_m[i] + velocity_m_s_[i] * passed_s;
      const bool inside = std::abs(to_m) < workspace_m_;
      pose_.position_m[i] = std::clamp(to_m, -workspace_m_, workspace_m_);
      pose_.linear_velocity_m_s[i] = inside ? velocity_m_s_[i] : 0.0;
    }
    pose_.angular_velocity_rad_s = turn_;
    turn(passed_s);
    reading = pose_;
    return true;
  }

  void write(const DriverWrench&) override {}

  void close() override {
    if (is_open_) spnav_close();
    is_open_ = false;
  }

 private:
  /// spnav: x right, y up, z away from the operator, and right-handed turns about them, as in libspnav's
  /// spnav_posrot_moveobj(). The scene: x right, y away, z up.
  void take(const spnav_event& event) {
    if (event.type == SPNAV_EVENT_MOTION) {
      const auto& m = event.motion;
      const double speed = speed_m_s_ / kFullDeflection, turn = turn_rad_s_ / kFullDeflection;
      velocity_m_s_ = {speed * m.x, speed * m.z, speed * m.y};
      turn_ = {turn * m.rx, turn * m.rz, turn * m.ry};
    } else if (event.type == SPNAV_EVENT_DEV && event.dev.op == SPNAV_DEV_RM) {
      throw std::runtime_error("the SpaceMouse was unplugged");
    } else if (event.type == SPNAV_EVENT_BUTTON && event.button.bnum >= 0 && event.button.bnum < 32) {
      const std::uint32_t bit = std::uint32_t{1} << static_cast<unsigned>(event.button.bnum);
      pose_.buttons = event.button.press != 0 ? pose_.buttons | bit : pose_.buttons & ~bit;
    }
  }

  void turn(double passed_s) {
    const Eigen::Map<const Eigen::Vector3d> rate(turn_.data());
    auto& [w, x, y, z] = pose_.orientation;
    const Eigen::AngleAxisd turned(rate.norm() * passed_s, rate.stableNormalized());
    const Eigen::Quaterniond q = (turned * Eigen::Quaterniond(w, x, y, z)).normalized();
    pose_.orientation = {q.w(), q.x(), q.y(), q.z()};
  }

  double speed_m_s_ = 0.0, turn_rad_s_ = 0.0, workspace_m_ = 0.0;
  bool is_open_ = false;
  Clock::time_point begin_;
  Triple velocity_m_s_{}, turn_{};
  DriverReading pose_;
};

constexpr DriverPlugin kPlugin{
    .name = "spacemouse", .version = "1", .settings = "speed_m_s=0.1 turn_rad_s=1 dof=6 workspace_m=0.5", .make = [] {
      return std::unique_ptr<DeviceDriver>(std::make_unique<SpaceMouseDriver>());
    }};

}  // namespace

SUBWORLD_DRIVER_PLUGIN(kPlugin)
