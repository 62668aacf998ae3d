#include "device_sim/driver_thread.hpp"

#include "device_sim/driver_check.hpp"
#include "rt/newest.hpp"
#include "rt/scheduling.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <thread>

namespace subworld {

/// Shared by both threads: it lives as long as the longer one.
struct DriverThread::Exchange {
  struct Wanted {
    TimePoint since{};
    DriverWrench wrench;
  };

  const DriverPlugin* plugin = nullptr;
  std::string settings;
  int user = 0, domain = 0;
  Newest<Sample> samples{Sample{}};
  Newest<Report> reports{Report{}};
  Newest<Wanted> wanted{Wanted{}};
  std::atomic<bool> stop = false, ended = false;
  Sample last;         // of the driver's thread
  Report last_report;  // of the driver's thread

  void publish(Phase phase, const char* text) {
    ++last_report.number;
    last_report.phase = phase;
    last_report.text.fill('\0');
    std::strncpy(last_report.text.data(), text, last_report.text.size() - 1);
    reports.renew([&](Report& slot) { slot = last_report; });
  }
};

namespace {

std::array<double, 3> limited(const std::array<double, 3>& v, double most) noexcept {
  const double size = std::hypot(v[0], v[1], v[2]);
  const double part = size > most ? most / size : 1.0;
  return {part * v[0], part * v[1], part * v[2]};
}

bool finite(const std::array<double, 3>& v) noexcept { return std::isfinite(std::hypot(v[0], v[1], v[2])); }

/// What a driver outputs, whatever was wanted: finite, within the device's limits, and from zero after an interruption.
class Output {
 public:
  explicit Output(const DriverCapabilities& capabilities) : capabilities_(capabilities) {}

  /// `wanted` is `age_s` old; `now`: the time of the output.
  DriverWrench of(const DriverWrench& wanted, double age_s, TimePoint now) noexcept {
    const double passed_s = to_seconds(now - last_);
    last_ = now;
    const bool valid = age_s < kOldWrench_s && finite(wanted.force_n) && finite(wanted.torque_n_m);
    if (!valid || passed_s > std::max(kOldWrench_s, 2.0 / capabilities_.rate_hz)) {
      risen_ = 0.0;
      return {};
    }
    risen_ = std::min(1.0, risen_ + passed_s / kOutputRise_s);
    DriverWrench out{limited(wanted.force_n, capabilities_.force_limit_n),
                     limited(wanted.torque_n_m, capabilities_.torque_limit_n_m)};
    for (double& f : out.force_n) f *= risen_;
    for (double& t : out.torque_n_m) t *= risen_;
    return out;
  }

 private:
  DriverCapabilities capabilities_;
  TimePoint last_{};
  double risen_ = 0.0;  ///< 0 to 1
};

/// Output of zero and close(), of a driver that may be defective.
void end(DeviceDriver& driver, bool renders) noexcept {
  try {
    if (renders) driver.write({});
  } catch (...) {  // close() is what remains
  }
  try {
    driver.close();
  } catch (...) {  // there is nothing left to do
  }
}

}  // namespace

DriverThread::DriverThread(const DriverPlugin& plugin, std::string settings, int user, int domain)
    : exchange_(std::make_shared<Exchange>()) {
  exchange_->plugin = &plugin;
  exchange_->settings = std::move(settings);
  exchange_->user = user;
  exchange_->domain = domain;
  using Wanted = Exchange::Wanted;
  const auto serve = [](Exchange& x) {
    std::unique_ptr<DeviceDriver> driver;
    bool renders = false;
    try {
      driver = x.plugin->make();
      const DriverCapabilities capabilities = driver->open({x.settings, x.user, x.domain});
      if (const std::string fault = fault_of(capabilities); !fault.empty()) throw std::runtime_error(fault);
      x.last_report.capabilities = capabilities;
      renders = capabilities.force_limit_n > 0.0;
      x.publish(Phase::open, "");
      Output output(capabilities);
      Cyclic release(Clock::now(), from_seconds(1.0 / capabilities.rate_hz));
      while (!x.stop) {
        release.wait();
        release.skip(Clock::now());
        if (driver->read(x.last.reading)) {
          ++x.last.number;
          x.samples.renew([&](Sample& slot) { slot = x.last; });
        }
        if (!renders) continue;
        Wanted newest;
        x.wanted.read([&](const Wanted& wanted) { newest = wanted; });
        const TimePoint now = Clock::now();
        driver->write(output.of(newest.wrench, to_seconds(now - newest.since), now));
      }
    } catch (const std::invalid_argument& wrong) {
      x.publish(Phase::refused, wrong.what());
    } catch (const std::exception& lost) {
      x.publish(Phase::lost, lost.what());
    } catch (...) {
      x.publish(Phase::lost, "an exception that is no std::exception");
    }
    if (driver) end(*driver, renders);
  };
  std::thread([x = exchange_, serve] {
    (void)claim_realtime(priority::kDevice);
    while (!x->stop) {
      serve(*x);
      const TimePoint again = Clock::now() + from_seconds(kRetry_s);
      while (!x->stop && Clock::now() < again) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    x->ended = true;
  }).detach();
}

DriverThread::~DriverThread() {
  write({});
  exchange_->stop = true;
  const TimePoint end = Clock::now() + from_seconds(kPatience_s);
  while (!exchange_->ended && Clock::now() < end) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

DriverThread::Sample DriverThread::newest() const noexcept {
  Sample sample;
  exchange_->samples.read([&](const Sample& newest) { sample = newest; });
  return sample;
}

DriverThread::Report DriverThread::report() const noexcept {
  Report report;
  exchange_->reports.read([&](const Report& newest) { report = newest; });
  return report;
}

void DriverThread::write(const DriverWrench& wrench) noexcept {
  exchange_->wanted.renew([&](auto& slot) { slot = {Clock::now(), wrench}; });
}

}  // namespace subworld
