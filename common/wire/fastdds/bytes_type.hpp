#pragma once

#include "wire/backend.hpp"
#include "wire/fastdds/vendor.hpp"

#include <cstring>
#include <span>
#include <vector>

namespace subworld::wire::fast {

inline constexpr std::uint32_t kFirstBytes = 512;  // of a history entry; grows with its samples

/// Argument of the data type in the middleware's calls: the sender's bytes, or a buffer for received ones.
struct Sample {
  std::span<const std::uint8_t> sent;
  std::vector<std::uint8_t> received;
};

/// One type for every topic: it copies bytes. The key comes first in them.
class BytesType final : public DataType {
 public:
  explicit BytesType(const TopicSpec& topic)
      : DataType(topic.type, kFirstBytes, topic.key_words > 0), key_words_(topic.key_words) {}

  bool serialize(const void* data, rtps::SerializedPayload_t& payload, dds::DataRepresentationId_t) override {
    const auto bytes = static_cast<const Sample*>(data)->sent;
    if (bytes.size() > payload.max_size) return false;
    std::memcpy(payload.data, bytes.data(), bytes.size());
    payload.length = static_cast<std::uint32_t>(bytes.size());
    payload.encapsulation = CDR_LE;
    return true;
  }

  bool deserialize(rtps::SerializedPayload_t& payload, void* data) override {
    static_cast<Sample*>(data)->received.assign(payload.data, payload.data + payload.length);
    return true;
  }

  std::uint32_t calculate_serialized_size(const void* data, dds::DataRepresentationId_t) override {
    return static_cast<std::uint32_t>(static_cast<const Sample*>(data)->sent.size());
  }

  void* create_data() override { return new Sample; }
  void delete_data(void* data) override { delete static_cast<Sample*>(data); }

  bool compute_key(rtps::SerializedPayload_t& payload, rtps::InstanceHandle_t& handle, bool) override {
    return key_of({payload.data, payload.length}, handle);
  }
  bool compute_key(const void* data, rtps::InstanceHandle_t& handle, bool) override {
    const auto* sample = static_cast<const Sample*>(data);
    return key_of(sample->sent.empty() ? sample->received : sample->sent, handle);
  }

 private:
  bool key_of(std::span<const std::uint8_t> bytes, rtps::InstanceHandle_t& handle) const {
    if (key_words_ == 0) return false;
    // A reader of Fast DDS 2.9 ends its process for a sample without a key. Too short ones get zeros; the codec rejects
    // them.
    const bool complete = bytes.size() >= kHeaderBytes + 4 * key_words_;
    const bool little = complete && (bytes[1] & 1) != 0;
    for (std::uint32_t i = 0; i < 16; ++i) {
      const std::uint32_t from = little ? (i ^ 3U) : i;  // a key is big-endian
      handle.value[i] = complete && i < 4 * key_words_ ? bytes[kHeaderBytes + from] : std::uint8_t{0};
    }
    return true;
  }

  std::uint32_t key_words_;
};

}  // namespace subworld::wire::fast
