#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
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
  [[nodiscard]] bool add_control(std::string text) {
    if (control_bytes_ + text.size() > limits_.control_bytes) return false;
    control_bytes_ += text.size();
    control_.push_back(std::move(text));
    return true;
  }
  void add_data(std::uint32_t subscription, Sample sample) {
    const auto same = std::ranges::find_if(
        data_, [&](const Data& one) { return one.subscription == subscription && one.sample.key == sample.key; });
    data_bytes_ += sample.bytes->size();
    if (same == data_.end()) {
      data_.push_back({subscription, std::move(sample)});
    } else {
      data_bytes_ -= std::exchange(same->sample, std::move(sample)).bytes->size();
      ++dropped_;
    }
    shrink(limits_.data_bytes);
  }
  /// Drops the oldest data beyond a size.
  void shrink(std::size_t data_bytes) {
    for (; data_bytes_ > data_bytes && data_.size() > 1; ++dropped_) (void)take_data();
  }
  /// Drops what waits for a subscription that ends.
  void forget(std::uint32_t subscription) {
    std::erase_if(data_, [&](const Data& one) {
      const bool ended = one.subscription == subscription;
      if (ended) data_bytes_ -= one.sample.bytes->size();
      return ended;
    });
  }
  /// Takes the next message; empty if nothing waits.
  [[nodiscard]] std::optional<Message> take() {
    if (control_.empty()) return data_.empty() ? std::nullopt : std::optional(Message{{}, take_data()});
    Message message{std::move(control_.front()), {}};
    control_.pop_front();
    control_bytes_ -= message.text.size();
    return message;
  }

  /// Samples that were replaced or dropped before they could be sent.
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }
  [[nodiscard]] std::size_t bytes() const noexcept { return control_bytes_ + data_bytes_; }

 private:
  Data take_data() {
    Data data = std::move(data_.front());
    data_.pop_front();
    data_bytes_ -= data.sample.bytes->size();
    return data;
  }

  Limits limits_;
  std::deque<std::string> control_;
  std::deque<Data> data_;  // oldest first
  std::size_t control_bytes_ = 0;
  std::size_t data_bytes_ = 0;
  std::uint64_t dropped_ = 0;
};

}  // namespace subworld::live
