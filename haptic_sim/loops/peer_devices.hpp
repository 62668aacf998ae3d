#pragma once

#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"
#include "rt/cyclic.hpp"
#include "wire/bus.hpp"
#include "wire/take.hpp"

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <semaphore>
#include <span>
#include <string>
#include <thread>
#include <vector>

namespace subworld {

/// All devices in lock-step, where each state counts from the first on. One reader: each is announced to each program,
/// and one for each user would grow with the cube of their number.
class AllDevices {
 public:
  /// `own`: the user whose device is not asked for here.
  AllDevices(Bus& bus, std::size_t users, std::size_t own)
      : reader_(bus.reader<DeviceState>(kAllDevices)), own_(own), waiting_(users) {}

  [[nodiscard]] int matched() const noexcept { return reader_.matched(); }

  /// The states of one user's device. As a `Reader`.
  class Of {
   public:
    Of(AllDevices& all, std::size_t user) noexcept : all_(all), user_(user) {}
    bool receive() { return all_.receive(user_); }
    bool decode(DeviceState& state);
    [[nodiscard]] int matched() const noexcept { return all_.reader_.matched(); }
    [[nodiscard]] int alive_writers() const noexcept { return all_.reader_.alive_writers(); }
    [[nodiscard]] std::uint64_t refused() const noexcept { return all_.reader_.refused(); }

   private:
    AllDevices& all_;
    std::size_t user_;
  };
  [[nodiscard]] Of of(std::size_t user) noexcept { return {*this, user}; }

 private:
  bool receive(std::size_t user);

  Reader<DeviceState> reader_;
  std::size_t own_;
  std::vector<std::deque<DeviceState>> waiting_;  ///< by user
};

/// The devices of the other users in real time. A reader is opened when its user can first be felt, so that others cost
/// nothing, and in a thread of its own: opening takes milliseconds.
class PeerDevices {
 public:
  /// At most 64 users. The bus must outlive this.
  PeerDevices(Bus& bus, const Scene& scene);
  ~PeerDevices();
  PeerDevices(const PeerDevices&) = delete;
  PeerDevices& operator=(const PeerDevices&) = delete;

  /// Starts the thread that opens readers for find(). It inherits the caller's scheduling.
  void open_in_background();
  /// The reader of a user's device; null until it is open. Does not block.
  [[nodiscard]] Reader<DeviceState>* find(std::size_t user) noexcept;
  /// Why the last reader could not be opened; empty: none failed. Call when the loop is over.
  [[nodiscard]] std::string fault();

 private:
  void open(std::size_t user);
  void work();
  void stop();

  Bus& bus_;
  std::vector<double> periods_s_;                            ///< of the devices, by user
  std::vector<std::optional<Reader<DeviceState>>> readers_;  ///< by user
  std::atomic<std::uint64_t> wanted_{0};                     ///< users whose readers find() has asked for
  std::counting_semaphore<> asking_{0};
  std::atomic<std::uint64_t> open_{0};
  std::atomic<bool> stopped_{false};
  std::string fault_;
  std::thread thread_;
};

/// Their newest states in real time.
class PeerStates {
 public:
  explicit PeerStates(std::size_t users) : peers_(users), known_(users) {}

  /// The newest states of the devices of the `felt` users (SubWorldFacts::peers), in the run `session`; null: none
  /// counts. Where a device has been started again, the world's account of it counts for a while: only that knows where
  /// the new one is in the scene.
  template <class Stages>
  std::span<const DeviceState* const> receive(PeerDevices& devices, std::uint64_t session, std::uint64_t felt,
                                              TimePoint now, Stages& stages) {
    DeviceState came;
    for (std::size_t p = 0; p < peers_.size(); ++p) {
      known_[p] = nullptr;
      Reader<DeviceState>* const reader = (felt >> p & 1U) != 0 ? devices.find(p) : nullptr;
      if (reader == nullptr) continue;
      auto& [state, since] = peers_[p];
      while (take(*reader, came, stages) == Take::sample) {
        if (came.session != session) continue;
        reader->trust_sender();
        if (state.sender != 0 && came.sender != state.sender) since = now;
        state = came;
      }
      if (state.session == session && to_seconds(now - since) > kAbsent_s) known_[p] = &state;
    }
    return known_;
  }

 private:
  struct Peer {
    DeviceState state;
    TimePoint since;  ///< when this device took the place of another
  };
  std::vector<Peer> peers_;                ///< by user
  std::vector<const DeviceState*> known_;  ///< by user
};

}  // namespace subworld
