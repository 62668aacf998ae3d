#include "device_sim/driver_check.hpp"

#include "rt/cyclic.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <thread>

namespace subworld {

namespace {

constexpr double kUnit = 1e-3;          ///< largest deviation of a quaternion's length from 1
constexpr double kBeyond = 1.5;         ///< times the workspace, that a position may be away from 0
constexpr double kFastest_rad = 100.0;  ///< angular speed, rad/s

template <std::size_t N>
bool finite(const std::array<double, N>& values) noexcept {
  return std::ranges::all_of(values, [](double value) { return std::isfinite(value); });
}

bool within(double value, double least, double most) noexcept { return value >= least && value <= most; }

constexpr double kLongestCall_s = 0.01;  ///< or 2 periods, if longer
constexpr double kLongestOpen_s = 10.0;
constexpr double kHung_s = 2.0;         ///< a call that lasts longer never returns
constexpr double kRateRatio = 0.2;      ///< deviation of the rate of readings from that of the capabilities
constexpr double kPaceRatio = 0.1;      ///< deviation of the device's clock from seconds
constexpr double kVelocityRatio = 0.3;  ///< deviation of the way by velocities from that by positions
constexpr double kSomeWay_m = 0.01;     ///< with less, velocities are not judged
constexpr double kLeastTime_s = 0.2;    ///< with less, rates are not judged

/// What the driver's thread has seen. It outlives a check that abandons it: all is owned by both.
struct Seen {
  std::atomic<int> calls = 0;  ///< changes while the driver returns from its calls
  std::atomic<bool> ended = false;
  DriverCapabilities capabilities;
  bool opened = false, closed = false, reopened = false;
  std::string failed_call, failure;  ///< the call that threw, and its text
  std::string capabilities_fault;
  std::uint64_t readings = 0, writes = 0;
  std::array<std::uint64_t, static_cast<std::size_t>(ReadingFault::count)> faults{};
  double longest_read_s = 0.0, longest_write_s = 0.0, read_for_s = 0.0;
  double device_s = 0.0;  ///< passed on the device's clock
  double way_m = 0.0, way_by_velocity_m = 0.0;
};

/// Runs one call, with its duration and its exception. False if it threw.
bool call(Seen& seen, const char* name, double& longest_s, const std::function<void()>& body) {
  const TimePoint begin = Clock::now();
  std::string failure;
  try {
    body();
  } catch (const std::exception& thrown) {
    failure = thrown.what();
    if (failure.empty()) failure = "an exception without a text";
  } catch (...) {
    failure = "an exception that is no std::exception";
  }
  longest_s = std::max(longest_s, to_seconds(Clock::now() - begin));
  ++seen.calls;
  if (failure.empty()) return true;
  if (seen.failure.empty()) {
    seen.failed_call = name;
    seen.failure = failure;
  }
  return false;
}

void account(Seen& seen, const DriverReading& now, const DriverReading& before) {
  const double passed_s = now.time_s - before.time_s;
  seen.device_s += passed_s;
  std::array<double, 3> way{};
  for (std::size_t i = 0; i < 3; ++i) way[i] = now.position_m[i] - before.position_m[i];
  seen.way_m += length_of(way);
  seen.way_by_velocity_m += length_of(now.linear_velocity_m_s) * passed_s;
}

void read_for(Seen& seen, DeviceDriver& driver, double duration_s) {
  const DriverCapabilities& c = seen.capabilities;
  const TimePoint begin = Clock::now();
  Cyclic release(begin, from_seconds(1.0 / c.rate_hz));
  DriverReading before;
  while (to_seconds(Clock::now() - begin) < duration_s) {
    release.wait();
    release.skip(Clock::now());
    DriverReading reading;
    bool fresh = false;
    if (!call(seen, "read", seen.longest_read_s, [&] { fresh = driver.read(reading); })) break;
    if (fresh) {
      const ReadingFault fault = judge(reading, seen.readings > 0 ? &before : nullptr, c);
      ++seen.faults[static_cast<std::size_t>(fault)];
      if (seen.readings > 0 && fault != ReadingFault::not_finite) account(seen, reading, before);
      ++seen.readings;
      before = reading;
    }
    if (c.force_limit_n <= 0.0) continue;
    if (!call(seen, "write", seen.longest_write_s, [&] { driver.write({}); })) break;
    ++seen.writes;
  }
  seen.read_for_s = to_seconds(Clock::now() - begin);
}

/// All that the check asks of a driver, in the driver's thread.
void exercise(Seen& seen, const DriverPlugin& plugin, const DriverCheckRequest& request) {
  double ignored_s = 0.0;
  std::unique_ptr<DeviceDriver> driver = plugin.make();
  const auto open = [&] {
    return call(seen, "open", ignored_s,
                [&] { seen.capabilities = driver->open({.settings = request.settings, .user = request.user}); });
  };
  seen.opened = open();
  if (seen.opened) seen.capabilities_fault = fault_of(seen.capabilities);
  if (seen.opened && seen.capabilities_fault.empty()) read_for(seen, *driver, request.duration_s);
  seen.closed = call(seen, "close", ignored_s, [&] { driver->close(); });
  if (!seen.opened || !seen.failure.empty()) return;
  driver = plugin.make();
  seen.reopened = open();
  (void)call(seen, "close", ignored_s, [&] { driver->close(); });
}

/// False if a call did not return.
bool all_calls_return(const Seen& seen) {
  int calls = -1;
  TimePoint since = Clock::now();
  while (!seen.ended) {
    if (const int now = seen.calls; now != calls) {
      calls = now;
      since = Clock::now();
    }
    if (to_seconds(Clock::now() - since) > (calls == 0 ? kLongestOpen_s : kHung_s)) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

std::vector<DriverProperty> judge_readings(const Seen& seen) {
  const DriverCapabilities& c = seen.capabilities;
  std::vector<DriverProperty> all;
  const auto add = [&](const char* name, bool held, std::string found) {
    all.push_back({name, held, std::move(found)});
  };
  const auto count = [&](const char* name, ReadingFault fault) {
    const std::uint64_t bad = seen.faults[static_cast<std::size_t>(fault)];
    add(name, bad == 0, fmt::format("{} of {} readings are not", bad, seen.readings));
  };
  add("readings arrive", seen.readings > 1, fmt::format("{} in {:.2f} s", seen.readings, seen.read_for_s));
  const double longest_s = std::max(kLongestCall_s, 2.0 / c.rate_hz);
  add("read() returns in time", seen.longest_read_s <= longest_s,
      fmt::format("longest {:.1f} ms; at most {:.1f} ms", 1e3 * seen.longest_read_s, 1e3 * longest_s));
  if (seen.readings < 2) return all;
  count("values are finite", ReadingFault::not_finite);
  count("orientations are unit quaternions", ReadingFault::orientation);
  count("positions are within the workspace, in metres", ReadingFault::workspace);
  count("time does not run backwards", ReadingFault::time);
  count("no jumps: slower than 10 m/s", ReadingFault::jump);
  add("the device was moved", seen.way_m > 0.0,
      seen.way_m > 0.0 ? fmt::format("{:.3f} m", seen.way_m)
                       : "all positions are equal: move the device, or it is frozen");
  if (seen.read_for_s > kLeastTime_s) {
    const double rate_hz = static_cast<double>(seen.readings) / seen.read_for_s;
    add("readings come at the rate of the capabilities", std::abs(rate_hz / c.rate_hz - 1.0) <= kRateRatio,
        fmt::format("{:.0f} Hz of {:.0f} Hz", rate_hz, c.rate_hz));
    const double pace = seen.device_s / seen.read_for_s;
    add("time is in seconds", std::abs(pace - 1.0) <= kPaceRatio,
        fmt::format("{:.4g} of the device's in a second", pace));
  }
  if (c.measures_velocity && seen.way_m > kSomeWay_m) {
    const double ratio = seen.way_by_velocity_m / seen.way_m;
    add("velocities agree with the positions", std::abs(ratio - 1.0) <= kVelocityRatio,
        fmt::format("the way by velocities is {:.4g} of that by positions", ratio));
  }
  if (c.force_limit_n > 0.0) {
    add("write() returns in time", seen.longest_write_s <= longest_s,
        fmt::format("longest {:.1f} ms; at most {:.1f} ms", 1e3 * seen.longest_write_s, 1e3 * longest_s));
  }
  return all;
}

}  // namespace

std::vector<DriverProperty> check_driver(const DriverPlugin& plugin, const DriverCheckRequest& request) {
  const auto seen = std::make_shared<Seen>();
  std::thread([seen, &plugin, request] {
    try {
      exercise(*seen, plugin, request);
    } catch (...) {  // make() or a destructor
      seen->failed_call = "make";
      seen->failure = "an exception";
    }
    seen->ended = true;
  }).detach();
  if (!all_calls_return(*seen)) return {{"every call returns", false, "a call has not returned; it was abandoned"}};

  std::vector<DriverProperty> all{{"every call returns", true, "all did"}};
  all.push_back({"no call throws", seen->failure.empty(),
                 seen->failure.empty() ? "none did" : fmt::format("{}(): {}", seen->failed_call, seen->failure)});
  if (!seen->opened) return all;
  all.push_back({"capabilities are valid", seen->capabilities_fault.empty(),
                 seen->capabilities_fault.empty() ? "they are" : seen->capabilities_fault});
  if (!seen->capabilities_fault.empty()) return all;
  for (DriverProperty& one : judge_readings(*seen)) all.push_back(std::move(one));
  if (seen->failure.empty())
    all.push_back({"opens again after close()", seen->reopened, seen->reopened ? "it does" : "it does not"});
  return all;
}

ReadingFault judge(const DriverReading& reading, const DriverReading* before,
                   const DriverCapabilities& capabilities) noexcept {
  if (!std::isfinite(reading.time_s) || !finite(reading.position_m) || !finite(reading.orientation) ||
      !finite(reading.linear_velocity_m_s) || !finite(reading.angular_velocity_rad_s))
    return ReadingFault::not_finite;
  const auto& q = reading.orientation;
  if (std::abs(std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3])) - 1.0) > kUnit)
    return ReadingFault::orientation;
  for (const double coordinate : reading.position_m) {
    if (std::abs(coordinate) > kBeyond * capabilities.workspace_m) return ReadingFault::workspace;
  }
  if (capabilities.measures_velocity && (length_of(reading.linear_velocity_m_s) > kFastestReading_m_s ||
                                         length_of(reading.angular_velocity_rad_s) > kFastest_rad))
    return ReadingFault::jump;
  if (before == nullptr) return ReadingFault::none;
  const double passed_s = reading.time_s - before->time_s;
  if (passed_s < 0.0) return ReadingFault::time;
  const std::array<double, 3> way{reading.position_m[0] - before->position_m[0],
                                  reading.position_m[1] - before->position_m[1],
                                  reading.position_m[2] - before->position_m[2]};
  const double least_s = 1.0 / capabilities.rate_hz;
  return length_of(way) > kFastestReading_m_s * std::max(passed_s, least_s) ? ReadingFault::jump : ReadingFault::none;
}

std::string fault_of(const DriverCapabilities& capabilities) {
  const auto& c = capabilities;
  if (c.degrees_of_freedom != 3 && c.degrees_of_freedom != 6)
    return fmt::format("degrees_of_freedom is {}; it must be 3 or 6", c.degrees_of_freedom);
  if (!within(c.workspace_m, 1e-3, 10.0))
    return fmt::format("workspace_m is {}; it must be from 0.001 to 10 m", c.workspace_m);
  if (!within(c.force_limit_n, 0.0, 1e3))
    return fmt::format("force_limit_n is {}; it must be from 0 to 1000 N", c.force_limit_n);
  if (!within(c.torque_limit_n_m, 0.0, 100.0))
    return fmt::format("torque_limit_n_m is {}; it must be from 0 to 100 N m", c.torque_limit_n_m);
  if (!within(c.rate_hz, 10.0, 1e5)) return fmt::format("rate_hz is {}; it must be from 10 to 100000 Hz", c.rate_hz);
  return {};
}

}  // namespace subworld
