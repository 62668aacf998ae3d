#pragma once

#include "model/exchange.hpp"
#include "model/scene.hpp"
#include "wire/bus.hpp"

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <semaphore>
#include <string>
#include <thread>
#include <vector>

namespace subworld {

/// The devices of the other users. A reader is opened when its user can first be felt, so that others cost nothing, and
/// in a thread of its own: opening takes milliseconds.
class PeerDevices {
 public:
  /// At most 64 users. The bus must outlive this.
  PeerDevices(Bus& bus, const Scene& scene);
  ~PeerDevices();
  PeerDevices(const PeerDevices&) = delete;
  PeerDevices& operator=(const PeerDevices&) = delete;

  /// Opens the reader of a user now. Throws `Error` (middleware).
  Reader<DeviceState>& open(std::size_t user);
  /// Starts the thread that opens readers for find(). It inherits the caller's scheduling.
  void open_in_background();
  /// The reader of a user's device; null until it is open. Does not block.
  [[nodiscard]] Reader<DeviceState>* find(std::size_t user) noexcept;
  /// Why the last reader could not be opened; empty: none failed. Call when the loop is over.
  [[nodiscard]] std::string fault();

 private:
  void work();
  void stop();

  Bus& bus_;
  std::vector<double> periods_s_;                            ///< of the devices, by user
  std::vector<std::optional<Reader<DeviceState>>> readers_;  ///< by user
  std::uint64_t asked_ = 0;                                  ///< users whose readers find() has asked for
  std::atomic<std::uint64_t> wanted_{0};                     ///< the same, for the thread
  std::counting_semaphore<> asking_{0};
  std::atomic<std::uint64_t> open_{0};
  std::atomic<bool> stopped_{false};
  std::string fault_;
  std::thread thread_;
};

}  // namespace subworld
