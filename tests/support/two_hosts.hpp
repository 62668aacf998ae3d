#pragma once

#include "link/network.hpp"
#include "support/process.hpp"
#include "support/wire_pairs.hpp"
#include "wire/bus.hpp"

#include <gtest/gtest.h>

#include <signal.h>
#include <sys/wait.h>
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>

namespace subworld::test {

/// The program `wire_peer`, which is in the test's folder, with its words.
inline std::string peer_command(const std::string& words) {
  return (std::filesystem::read_symlink("/proc/self/exe").parent_path() / "wire_peer").string() + " " + words;
}

/// Newest contents of what the peer has sent.
struct FromPeer {
  std::uint64_t reports = 0;    ///< received
  std::uint64_t stamp = 0;      ///< of the newest report
  std::uint64_t frame = 0;      ///< that the peer had received when it wrote the report
  std::uint64_t command = 0;    ///< that the peer had received when it wrote the state
  std::uint32_t alive = 0;      ///< writers that were alive for the peer's two readers
  std::uint64_t disorders = 0;  ///< reports whose stamp is not the next one
  std::uint64_t lost = 0;       ///< reports that never came
  /// Longest time between two receipts, in samples that the peer wrote in it, and at most as many as this side looked
  /// in vain: a machine that is late counts on neither side.
  std::uint64_t gap = 0;
  std::uint64_t pid = 0;  ///< of the peer, as it sees itself
};

/// Two hosts with a link: this process has a bus on the first one, and `wire_peer` runs on the second one. A test calls
/// `start` and then `exchange_until`.
class TwoHosts : public ::testing::Test {
 protected:
  void TearDown() override { kill_peer(); }

  /// False where the machine does not permit it: the test is then skipped.
  bool make_hosts() try {
    network_ = std::make_unique<EmulatedNetwork>();
    network_->add_host("a");
    network_->add_host("b");
    network_->start();
    return true;
  } catch (const Error& error) {
    const std::string text = error.what();
    if (text.find("not permitted") == std::string::npos && text.find("/dev/net/tun") == std::string::npos) throw;
    return false;
  }

  /// Opens the bus of a vendor here.
  void open(Vendor vendor, Mode mode) {
    network_->host(0).inside([&] {
      BusConfig config = config_of(vendor, kDomain, mode);
      config.interface_address = EmulatedNetwork::kInterface;
      config.peers = {network_->address(1)};
      config.cycle_s = config.device_period_s = kPeriod_s;
      bus_ = open_bus(config);
      frames_.emplace(bus_->writer<WorldFrame>());
      commands_.emplace(bus_->writer<DeviceCommand>());
      reports_.emplace(bus_->reader<HapticReport>());
      states_.emplace(bus_->reader<DeviceState>());
    });
  }

  void close() {
    states_.reset();
    reports_.reset();
    commands_.reset();
    frames_.reset();
    bus_.reset();
  }

  /// Opens the bus of the pair's second vendor here, and the peer with the first one.
  void start(const VendorPair& pair, Mode mode) {
    open(pair.second, mode);
    start_peer(pair.first, mode);
  }

  /// `by`: a command that starts the peer in its place.
  void start_peer(Vendor vendor, Mode mode, const std::string& by = {}) {
    peer_ = network_->host(1).start("exec " + by +
                                    peer_command(std::string(name_of(vendor)) + " " + std::to_string(kDomain) + " " +
                                                 (mode == Mode::realtime ? "realtime" : "lockstep") + " " +
                                                 EmulatedNetwork::kInterface + " " + network_->address(0)));
  }

  void kill_peer() {
    if (peer_ <= 0) return;
    kill(-peer_, SIGKILL);
    waitpid(peer_, nullptr, 0);
    peer_ = -1;
  }

  /// Writes a frame and a command every 10 ms and takes all that the peer sends, until the condition holds; false after
  /// a time that is exceeded only by a fault.
  template <class Condition>
  bool exchange_until(Condition condition, double limit_s = 40.0) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(limit_s);
    while (!condition()) {
      if (std::chrono::steady_clock::now() > end) return false;
      frame_.stamp = command_.sequence = ++written_;
      frames_->write(frame_);
      commands_->write(command_);
      take();
      std::this_thread::sleep_for(std::chrono::duration<double>(kPeriod_s));
    }
    return true;
  }

  /// Everything works: each side receives both topics, with what was written after this call, and counts the writers
  /// of the other side as alive.
  bool connected(double limit_s = 40.0) {
    const std::uint64_t begun = written_ + 1;
    return exchange_until(
        [&] {
          return heard_.frame >= begun && heard_.command >= begun && heard_.alive == 2 &&
                 reports_->alive_writers() > 0 && states_->alive_writers() > 0;
        },
        limit_s);
  }

  [[nodiscard]] std::string text() const {
    return "written " + std::to_string(written_) + ", the peer received frame " + std::to_string(heard_.frame) +
           " and command " + std::to_string(heard_.command) + ", alive there " + std::to_string(heard_.alive) +
           ", here " + std::to_string(reports_->alive_writers()) + " + " + std::to_string(states_->alive_writers()) +
           ", matched here " + std::to_string(reports_->matched()) + " + " + std::to_string(states_->matched());
  }

  static constexpr double kPeriod_s = 0.01;
  static constexpr int kDomain = 7;  ///< the hosts are this test's own
  std::unique_ptr<EmulatedNetwork> network_;
  FromPeer heard_;
  std::unique_ptr<Bus> bus_;
  std::optional<Writer<WorldFrame>> frames_;
  std::optional<Writer<DeviceCommand>> commands_;
  std::optional<Reader<HapticReport>> reports_;
  std::optional<Reader<DeviceState>> states_;

 private:
  void take() {
    const FromPeer before = heard_;
    ++vain_;
    while (reports_->take(report_) == Take::sample) {
      heard_.pid = report_.session;
      const std::uint64_t step = report_.stamp - heard_.stamp;
      if (heard_.reports > 0 && step != 1) ++heard_.disorders;
      if (heard_.reports > 0) heard_.lost += step - 1;
      heard_.stamp = report_.stamp;
      heard_.frame = report_.confirmed_stamp;
      ++heard_.reports;
    }
    if (heard_.reports > before.reports) {
      if (before.reports > 0) heard_.gap = std::max(heard_.gap, std::min(vain_, heard_.stamp - before.stamp));
      vain_ = 0;
    }
    while (states_->take(state_) == Take::sample) {
      heard_.command = static_cast<std::uint64_t>(state_.stamp_s);
      heard_.alive = state_.buttons;
    }
  }

  pid_t peer_ = -1;
  std::uint64_t written_ = 0;
  std::uint64_t vain_ = 0;  ///< looks for reports since the newest one
  WorldFrame frame_;
  DeviceCommand command_;
  HapticReport report_;
  DeviceState state_;
};

}  // namespace subworld::test
