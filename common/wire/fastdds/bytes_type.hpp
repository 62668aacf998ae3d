#pragma once

#include "wire/backend.hpp"
#include "wire/fastdds/vendor.hpp"

#include <fastdds/dds/topic/TopicDataType.hpp>

#include <cstring>
#include <functional>
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
class BytesType final : public dds::TopicDataType {
 public:
  explicit BytesType(const TopicSpec& topic) : key_words_(topic.key_words) {
    setName(topic.type);
    m_typeSize = kFirstBytes;
    m_isGetKeyDefined = key_words_ > 0;
    auto_fill_type_information(false);
    auto_fill_type_object(false);
  }

  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    const auto bytes = static_cast<Sample*>(data)->sent;
    if (bytes.size() > payload->max_size) return false;
    std::memcpy(payload->data, bytes.data(), bytes.size());
    payload->length = static_cast<std::uint32_t>(bytes.size());
    payload->encapsulation = CDR_LE;
    return true;
  }

  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    static_cast<Sample*>(data)->received.assign(payload->data, payload->data + payload->length);
    return true;
  }

  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<Sample*>(data)->sent.size()); };
  }

  void* createData() override { return new Sample; }
  void deleteData(void* data) override { delete static_cast<Sample*>(data); }

  bool getKey(void* data, rtps::InstanceHandle_t* handle, bool) override {
    const auto* sample = static_cast<const Sample*>(data);
    const std::span<const std::uint8_t> bytes = sample->sent.empty() ? sample->received : sample->sent;
    if (key_words_ == 0) return false;
    // A reader of Fast DDS 2.9 ends its process for a sample without a key. Too short ones get zeros; the codec rejects
    // them.
    const bool complete = bytes.size() >= kHeaderBytes + 4 * key_words_;
    const bool little = complete && (bytes[1] & 1) != 0;
    for (std::uint32_t i = 0; i < 16; ++i) {
      const std::uint32_t from = little ? (i ^ 3U) : i;  // a key is big-endian
      handle->value[i] = complete && i < 4 * key_words_ ? bytes[kHeaderBytes + from] : std::uint8_t{0};
    }
    return true;
  }

 private:
  std::uint32_t key_words_;
};

}  // namespace subworld::wire::fast
