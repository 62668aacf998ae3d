// Driver of a joystick with force feedback, by the kernel's event devices (evdev).
#include "device_sim/driver.hpp"
#include "device_sim/drivers/joystick_force.hpp"
#include "device_sim/drivers/settings.hpp"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <stdexcept>
#include <string>
#include <utility>

namespace {

using namespace subworld;
using Clock = std::chrono::steady_clock;

class JoystickDriver final : public DeviceDriver {
 public:
  ~JoystickDriver() override { close_file(); }

  DriverCapabilities open(const DriverRequest& request) override {
    DriverSettings settings(request.settings);
    path_ = settings.take("path", std::string("/dev/input/event0"));
    reach_m_ = settings.take("workspace_m", 0.1);
    full_n_ = settings.take("force_n", 2.0);
    settings.check();
    if (full_n_ < 0.0) throw std::invalid_argument("setting force_n: must not be negative");
    file_ = ::open(path_.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (file_ < 0) fail("open");
    query();
    if (full_n_ > 0.0) {
      show({});
      // A spring of the joystick's own would add to the force. The kernel ignores what a joystick does not have.
      if (!set(FF_GAIN, 0xffff) || !set(FF_AUTOCENTER, 0) || !set(effect_, 1))
        fail("force feedback; set force_n=0 without it");
    }
    begin_ = Clock::now();
    return {.degrees_of_freedom = 3,
            .workspace_m = reach_m_,
            .force_limit_n = full_n_,
            .torque_limit_n_m = 0.0,
            .rate_hz = 125.0,
            .measures_velocity = false};
  }

  bool read(DriverReading& reading) override {
    input_event event{};
    ssize_t bytes = 0;
    while ((bytes = ::read(file_, &event, sizeof event)) == sizeof event) take(event);
    if (bytes < 0 && errno != EAGAIN && errno != EINTR) fail("read");
    if (std::exchange(dropped_, false)) query();
    reading = {.time_s = std::chrono::duration<double>(Clock::now() - begin_).count(), .buttons = buttons_};
    // The kernel's y points to the operator, the scene's away.
    reading.position_m = {axis_position_m(x_.value, x_.minimum, x_.maximum, reach_m_),
                          -axis_position_m(y_.value, y_.minimum, y_.maximum, reach_m_), 0.0};
    return true;
  }

  void write(const DriverWrench& wrench) override { show(wrench.force_n); }

  void close() override {
    if (file_ >= 0 && effect_ >= 0) (void)ioctl(file_, EVIOCRMFF, effect_);
    close_file();
  }

 private:
  [[noreturn]] void fail(const char* what) const {
    throw std::runtime_error(path_ + ": " + what + ": " + std::strerror(errno));
  }

  /// Axes and buttons as they are, without events.
  void query() {
    std::array<unsigned char, KEY_MAX / 8 + 1> keys{};
    if (ioctl(file_, EVIOCGABS(ABS_X), &x_) < 0 || ioctl(file_, EVIOCGABS(ABS_Y), &y_) < 0 ||
        ioctl(file_, EVIOCGKEY(sizeof keys), keys.data()) < 0)
      fail("is no event device of a joystick");
    buttons_ = 0;
    for (unsigned i = 0; i < 32; ++i) {
      const unsigned key = BTN_JOYSTICK + i;
      if ((keys[key / 8] >> (key % 8) & 1U) != 0) buttons_ |= std::uint32_t{1} << i;
    }
  }

  [[nodiscard]] bool set(int code, int value) const {
    const input_event event{.time = {}, .type = EV_FF, .code = static_cast<__u16>(code), .value = value};
    return ::write(file_, &event, sizeof event) == sizeof event;
  }

  void take(const input_event& event) {
    if (event.type == EV_SYN && event.code == SYN_DROPPED) dropped_ = true;
    if (event.type == EV_ABS && event.code == ABS_X) x_.value = event.value;
    if (event.type == EV_ABS && event.code == ABS_Y) y_.value = event.value;
    const int button = event.code - BTN_JOYSTICK;
    if (event.type != EV_KEY || button < 0 || button >= 32) return;
    const std::uint32_t bit = std::uint32_t{1} << static_cast<unsigned>(button);
    buttons_ = event.value != 0 ? buttons_ | bit : buttons_ & ~bit;
  }

  /// The effect has no end: the kernel removes it when the file is closed, also that of a program that was killed.
  void show(const std::array<double, 3>& force_n) {
    ff_effect effect = constant_force(force_n, full_n_, effect_);
    if (ioctl(file_, EVIOCSFF, &effect) < 0) fail("force feedback; set force_n=0 without it");
    effect_ = effect.id;
  }

  void close_file() {
    if (file_ >= 0) ::close(file_);
    file_ = -1;
  }

  std::string path_;
  double reach_m_ = 0.0, full_n_ = 0.0;
  int file_ = -1, effect_ = -1;
  input_absinfo x_{}, y_{};
  std::uint32_t buttons_ = 0;
  bool dropped_ = false;  ///< the kernel has dropped events
  Clock::time_point begin_;
};

constexpr DriverPlugin kPlugin{
    .name = "joystick", .version = "1", .settings = "path=/dev/input/event0 workspace_m=0.1 force_n=2", .make = [] {
      return std::unique_ptr<DeviceDriver>(std::make_unique<JoystickDriver>());
    }};

}  // namespace

SUBWORLD_DRIVER_PLUGIN(kPlugin)
