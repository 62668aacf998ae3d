#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace subworld::live {

using Bytes = std::shared_ptr<const std::vector<std::uint8_t>>;

/// A message of a channel.
struct Sample {
  std::uint64_t key = 0;  ///< a newer one with this key replaces it
  std::uint64_t time_ns = 0;
  Bytes bytes;
};

/// What waits for one client. Control messages (texts) are lossless and come first. Of the data, the newest sample of
/// each key of a subscription waits; without room, the oldest are dropped.
class Outbox {
 public:
  struct Limits {
    std::size_t control_bytes = 8U << 20U;
    std::size_t data_bytes = 8U << 20U;
  };
  struct Data {
    std::uint32_t subscription = 0;
    Sample sample;
  };
  struct Message {
    std::string text;          ///< a control message, if it is not empty
    std::optional<Data> data;  ///< else a sample
  };

  Outbox() : Outbox(Limits{}) {}
  explicit Outbox(Limits limits) : limits_(limits) {}

  /// False where there is no room: the client cannot be served further.
  [[nodiscard]] bool add_control(std::string text);
  void add_data(std::uint32_t subscription, Sample sample);
  /// Drops what waits for a subscription that ends.
  void forget(std::uint32_t subscription);
  /// Takes the next message; empty if nothing waits.
  [[nodiscard]] std::optional<Message> take();

  /// Samples that were replaced or dropped before they could be sent.
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }
  [[nodiscard]] std::size_t bytes() const noexcept { return control_bytes_ + data_bytes_; }

 private:
  using Key = std::pair<std::uint32_t, std::uint64_t>;
  void erase(std::list<Data>::iterator at);

  Limits limits_;
  std::deque<std::string> control_;
  std::list<Data> data_;  // oldest first
  std::map<Key, std::list<Data>::iterator> by_key_;
  std::size_t control_bytes_ = 0;
  std::size_t data_bytes_ = 0;
  std::uint64_t dropped_ = 0;
};

}  // namespace subworld::live
